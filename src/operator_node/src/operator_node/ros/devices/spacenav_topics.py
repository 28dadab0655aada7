"""Topics of a 6-D mouse, with the names of `spacenav_node`."""

from collections.abc import Sequence
from typing import Any

import rospy
from geometry_msgs.msg import Twist, Vector3
from sensor_msgs.msg import Joy
from std_msgs.msg import Header

from operator_node.device import Reading
from operator_node.devices.spacenav import Spacenav

from .topics import DeviceTopics

QUEUE_SIZE = 10


class SpacenavTopics(DeviceTopics):
    """Publishes translation, rotation, both as a twist, and the unscaled axes, below `spacenav`."""

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
