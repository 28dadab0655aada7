"""The devices; a new one is a class in a file of its own and a line here.

A user's own one needs no line: `"their_package.module:Class"` serves wherever a name does.
"""

DEVICES: dict[str, str] = {
    "joystick": "operator_node.devices.joystick:Joystick",
    "keyboard": "operator_node.devices.keyboard:Keyboard",
    "mouse": "operator_node.devices.mouse:Mouse",
    "mvn": "operator_node.devices.mvn:Mvn",
    "spacenav": "operator_node.devices.spacenav:Spacenav",
}
"""Class of each device; imported when it is asked for, so that libraries that others lack do not matter."""
