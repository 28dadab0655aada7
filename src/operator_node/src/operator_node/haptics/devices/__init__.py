"""The haptic devices; a new one is a class in a file of its own and a line here.

A user's own one needs no line: `"their_package.module:Class"` serves wherever a name does.
"""

HAPTIC_DEVICES: dict[str, str] = {
    "haply": "operator_node.haptics.devices.haply:HaplyDevice",
    "scripted": "operator_node.haptics.devices.scripted:ScriptedDevice",
    "touch": "operator_node.ros.haptics.touch:TouchDevice",
    "virtual": "operator_node.haptics.devices.virtual:VirtualDevice",
}
"""Class of each device; imported when it is asked for, so that libraries that others lack do not matter."""
