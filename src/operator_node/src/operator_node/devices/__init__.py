"""The devices; a new one is a class in its own file and a line here."""

from custom_ros_tools.plugin_table import PluginTable
from operator_node.device import Device

DEVICES: PluginTable[Device] = PluginTable(
    "device",
    "operator_node.device:Device",
    {
        "joystick": "operator_node.devices.joystick:Joystick",
        "keyboard": "operator_node.devices.keyboard:Keyboard",
        "mouse": "operator_node.devices.mouse:Mouse",
        "mvn": "operator_node.devices.mvn:Mvn",
        "spacenav": "operator_node.devices.spacenav:Spacenav",
    },
)
"""All devices; each is imported when it is looked up, so a missing library matters to its own device only."""
