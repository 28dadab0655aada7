"""Former import path of the base class of a device's topics."""

from operator_node.devices.device_topics import DeviceTopics

__all__ = ["DeviceTopics"]
