"""Table of the input devices. A new device needs a class in a file of its own and a line in this table."""

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
"""All devices. A device is imported only when it is looked up, so a missing library affects only the devices that need
it.
"""
