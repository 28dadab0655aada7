"""Table of the haptic devices. A new device needs a class in a file of its own and a line in this table."""

from custom_ros_tools.plugin_table import PluginTable
from operator_node.haptics.device import HapticDevice

HAPTIC_DEVICES: PluginTable[HapticDevice] = PluginTable(
    "haptic device",
    "operator_node.haptics.device:HapticDevice",
    {
        "haply": "operator_node.haptics.devices.haply:HaplyDevice",
        "scripted": "operator_node.haptics.devices.scripted:ScriptedDevice",
        "touch": "operator_node.haptics.devices.touch_topics:TouchDevice",
        "virtual": "operator_node.haptics.devices.virtual:VirtualDevice",
    },
)
"""All haptic devices. A device is imported when it is looked up, so a missing library affects only this device."""
