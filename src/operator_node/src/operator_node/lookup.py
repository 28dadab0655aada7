"""From the name of a device or mapping to its class."""

from typing import cast

from custom_ros_tools.plugins import find_in_table

from .device import Device
from .devices import DEVICES
from .mappings import MAPPINGS
from .mappings.mapping import Mapping


def device_class(name: str) -> type[Device]:
    """Returns the class of a device.

    Args:
        name: A name of the table `DEVICES`, or `"their_package.module:Class"`.

    Raises:
        UnknownNameError: If the table does not have the name.
        MissingDependency: If it needs a library that is not installed.
        ValueError: If another package has no such class.
    """
    return cast(type[Device], find_in_table(name, Device, DEVICES, "device"))


def mapping_class(name: str) -> type[Mapping]:
    """Returns the class of a mapping; for the name and what it raises see `device_class`, with the table `MAPPINGS`."""
    return cast(type[Mapping], find_in_table(name, Mapping, MAPPINGS, "mapping"))
