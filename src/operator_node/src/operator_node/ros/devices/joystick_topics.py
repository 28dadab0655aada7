"""Topics of a joystick, with the names of `joy_node`."""

import math
from typing import Any

import rospy
from sensor_msgs.msg import Joy, JoyFeedback, JoyFeedbackArray

from operator_node.devices.joystick import Joystick

from .topics import DeviceTopics

QUEUE_SIZE = 10
STRONG = 0
"""Number of the strong motor; all other numbers are the weak one."""


class JoystickTopics(DeviceTopics):
    """Rumbles on `joy/set_feedback`, and moves the virtual gamepad on `joy/virtual`."""

    device: Joystick

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        options = {"queue_size": QUEUE_SIZE, "tcp_nodelay": True}
        rospy.Subscriber("joy/set_feedback", JoyFeedbackArray, self._on_feedback, **options)
        if self.device.is_virtual:
            rospy.Subscriber("joy/virtual", Joy, self._on_virtual, **options)

    def _on_feedback(self, message: JoyFeedbackArray) -> None:
        strengths = {True: 0.0, False: 0.0}
        for each in message.array:
            if each.type == JoyFeedback.TYPE_RUMBLE and math.isfinite(each.intensity):
                strengths[each.id == STRONG] = max(0.0, min(1.0, each.intensity))
        self.post(lambda: self.device.rumble(strengths[True], strengths[False]))

    def _on_virtual(self, message: Joy) -> None:
        if all(map(math.isfinite, message.axes)):
            self.post(lambda: self.device.move_virtual(message.axes, message.buttons))
