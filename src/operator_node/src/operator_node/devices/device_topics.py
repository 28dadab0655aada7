"""Topics of devices in addition to `joy`: the base class, and the topics of joystick, keyboard and 6-D mouse.

Most topics of the joystick are named as in ROS's `joy_node`, those of the 6-D mouse as in `spacenav_node`. The topics
of the keyboard are named as in the keyboard driver that this project's original release uses.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any

import rospy
from geometry_msgs.msg import Twist, Vector3
from keyboard.msg import Key
from sensor_msgs.msg import Joy, JoyFeedback, JoyFeedbackArray
from std_msgs.msg import Header

from operator_node.device import Device, Reading

from .joystick import Joystick
from .keys import KeyEvent
from .spacenav import Spacenav

QUEUE_SIZE = 10
KEY_QUEUE_SIZE = 100
STRONG = 0
"""Number of the strong motor in a feedback message; every other number selects the weak motor."""


class DeviceTopics:
    """Base class that publishes a device's events and subscribes to the device's inputs, on topics other than `joy`.

    Args:
        device: The device. Its state may be changed only by actions passed to `post`.
        post: Function that schedules an action in the thread that reads the device.
    """

    def __init__(self, device: Device, post: Callable[[Callable[[], None]], None]) -> None:
        self.device, self.post = device, post

    def publish(self, reading: Reading, stamp: rospy.Time) -> None:
        """Publishes the device-specific data of a reading. The base class publishes nothing."""


class JoystickTopics(DeviceTopics):
    """Makes the joystick rumble on request (`joy/set_feedback`), and moves a virtual gamepad (`joy/virtual`)."""

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


class KeyboardTopics(DeviceTopics):
    """Publishes a message on `~keydown` or `~keyup` for each key that goes down or up."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self._publishers = {
            is_down: rospy.Publisher(f"~{name}", Key, queue_size=KEY_QUEUE_SIZE, tcp_nodelay=True)
            for is_down, name in ((True, "keydown"), (False, "keyup"))
        }

    def publish(self, reading: Reading, stamp: rospy.Time) -> None:
        for event in reading.events:
            if isinstance(event, KeyEvent):
                message = Key(header=Header(stamp=stamp), code=event.code, modifiers=event.modifiers)
                self._publishers[event.is_down].publish(message)


class SpacenavTopics(DeviceTopics):
    """Publishes the readings of the 6-D mouse in the namespace `spacenav`.

    The topics are `offset` (scaled translation), `rot_offset` (scaled rotation), `twist` (both), and `joy` (unscaled
    axes, and buttons).
    """

    device: Spacenav

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self._offset, self._rot_offset, self._twist, self._joy = (
            rospy.Publisher(f"spacenav/{name}", kind, queue_size=QUEUE_SIZE, tcp_nodelay=True)
            for name, kind in (("offset", Vector3), ("rot_offset", Vector3), ("twist", Twist), ("joy", Joy))
        )

    def publish(self, reading: Reading, stamp: rospy.Time) -> None:
        linear = _scaled(reading.axes[:3], self.device.config.linear_scale)
        angular = _scaled(reading.axes[3:], self.device.config.angular_scale)
        self._offset.publish(linear)
        self._rot_offset.publish(angular)
        self._twist.publish(Twist(linear, angular))
        header = Header(stamp=stamp, frame_id="spacenav")
        self._joy.publish(Joy(header=header, axes=reading.axes, buttons=reading.buttons))


def _scaled(values: Sequence[float], scale: float | Sequence[float]) -> Vector3:
    factors = (scale,) * 3 if isinstance(scale, float | int) else scale
    return Vector3(*(value * factor for value, factor in zip(values, factors)))
