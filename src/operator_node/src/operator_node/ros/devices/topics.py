"""Former import path of the class `DeviceTopics`, kept for compatibility."""

from operator_node.devices.device_topics import DeviceTopics

__all__ = ["DeviceTopics"]
