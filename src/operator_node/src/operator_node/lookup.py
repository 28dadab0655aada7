"""From the name of a device or mapping to its class."""

from collections.abc import Callable, Mapping
from typing import Any, cast

from custom_ros_tools.plugins import configured_class
from custom_ros_tools.schema import ConfigModel

from .device import Device
from .devices import DEVICES
from .mappings import MAPPINGS
from .mappings.mapping import Mapping as AxesMapping


def device_class(name: str) -> type[Device]:
    """Returns the class of a device.

    Args:
        name: A name of the table `DEVICES`, or `"their_package.module:Class"`.

    Raises:
        UnknownNameError: If the table does not have the name.
        MissingDependency: If it needs a library that is not installed.
        ConfigError: If another package has no such class, or its module cannot be imported.
    """
    return cast(type[Device], configured_class(name, Device, DEVICES, "device"))


def make_device(name: str, data: Mapping[str, Any], file: str = "~") -> Device:
    """Makes a device, which is not open yet.

    Args:
        name: See `device_class`.
        data: Its options, as read from YAML.
        file: Where they come from, for messages.

    Raises:
        UnknownNameError: If there is no device of this name.
        MissingDependency: If it needs a library that is not installed.
        ConfigError: If its options are wrong; it names all that are.
    """
    kind = device_class(name)
    make = cast(Callable[[ConfigModel], Device], kind)
    return make(kind.Config.parse(data, file))


def make_mapping(name: str, data: Mapping[str, Any], file: str = "~config") -> AxesMapping:
    """Makes a mapping; for the arguments and what it raises see `make_device`, with the table `MAPPINGS`."""
    kind = cast(type[AxesMapping], configured_class(name, AxesMapping, MAPPINGS, "mapping"))
    make = cast(Callable[[ConfigModel], AxesMapping], kind)
    return make(kind.Config.parse(data, file))
