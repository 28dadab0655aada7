"""Listens to TF, and says now and then what is wrong with it."""

from __future__ import annotations

import math
from collections.abc import Callable

import rospy
import tf2_ros
from geometry_msgs.msg import TransformStamped
from tf2_msgs.msg import TFMessage

from custom_ros_tools.ros.lifecycle.throttle import ThrottledWarning
from rpbi.geometry import Pose

QUEUE_SIZE = 100
NORM_TOLERANCE = 0.01
"""How far the square of a quaternion's length may be from 1, as for tf2."""


class TfListener:
    """What is known of TF; `tf2_ros.TransformListener` does the same without looking at what comes.

    tf2 refuses by itself what is no transform, but prints two lines on the console each time, however often it comes.
    """

    def __init__(self) -> None:
        self._buffer = tf2_ros.Buffer()
        self._warn = ThrottledWarning()
        rospy.Subscriber("/tf", TFMessage, self._take, self._buffer.set_transform, queue_size=QUEUE_SIZE)
        rospy.Subscriber("/tf_static", TFMessage, self._take, self._buffer.set_transform_static, queue_size=QUEUE_SIZE)

    def pose(self, parent: str, child: str) -> Pose | None:
        """Returns the newest pose of a frame in another, None if there is none."""
        try:
            transform = self._buffer.lookup_transform(parent, child, rospy.Time(0)).transform
        except tf2_ros.TransformException:
            return None
        position, quat = transform.translation, transform.rotation
        return Pose((position.x, position.y, position.z), (quat.x, quat.y, quat.z, quat.w))

    def _take(self, message: TFMessage, store: Callable[[TransformStamped, str], None]) -> None:
        sender = message._connection_header.get("callerid", "")
        for transform in message.transforms:
            fault = fault_in(transform)
            if fault is None:
                store(transform, sender)
            else:
                self._warn(f"TF from {sender}", f"'{transform.child_frame_id}' refused: {fault}")


def fault_in(transform: TransformStamped) -> str | None:
    """Returns what is wrong with a transform, None if nothing is."""
    parent, child = transform.header.frame_id.strip("/"), transform.child_frame_id.strip("/")
    position, quat = transform.transform.translation, transform.transform.rotation
    if not parent or not child or parent == child:
        return f"expected two frames, got '{parent}' and '{child}'"
    # A sum is finite only if all of its parts are, unless they are far beyond any scene.
    if not math.isfinite(position.x + position.y + position.z):
        return f"expected a finite translation, got {position.x:g}, {position.y:g}, {position.z:g}"
    norm = quat.x * quat.x + quat.y * quat.y + quat.z * quat.z + quat.w * quat.w
    if not abs(norm - 1.0) < NORM_TOLERANCE:
        return f"expected a quaternion of length 1, got {quat.x:g}, {quat.y:g}, {quat.z:g}, {quat.w:g}"
    return None
