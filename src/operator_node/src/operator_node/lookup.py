"""From the name of a device or mapping to its class."""

from collections.abc import Callable, Mapping
from typing import Any, cast

from custom_ros_tools.errors import ConfigError, Problem
from custom_ros_tools.plugins import find_in_table
from custom_ros_tools.schema import ConfigModel

from .device import Device
from .devices import DEVICES


def device_class(name: str) -> type[Device]:
    """Returns the class of a device.

    Args:
        name: A name of the table `DEVICES`, or `"their_package.module:Class"`.

    Raises:
        UnknownNameError: If the table does not have the name.
        MissingDependency: If it needs a library that is not installed.
        ConfigError: If another package has no such class, or its module cannot be imported.
    """
    try:
        return cast(type[Device], find_in_table(name, Device, DEVICES, "device"))
    except ValueError as error:
        raise ConfigError([Problem("", "", f"device '{name}': {error}")]) from error


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
