"""TF listener that drops transforms which tf2 cannot handle."""

import math
from collections.abc import Callable

import rospy
import tf2_ros
from geometry_msgs.msg import TransformStamped
from tf2_msgs.msg import TFMessage

from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning

QUEUE_SIZE = 100
NORM_TOLERANCE = 0.01
"""Largest deviation of the square of a quaternion's length from 1, as in tf2; transforms beyond it are dropped."""
END_OF_TIME_S = 2**31
"""Stamp from which on tf2's C++ part reads invalid memory, which crashes the process [s]."""
NS_PER_S = 1_000_000_000


class TfListener:
    """Stores transforms of /tf and /tf_static in a buffer, like `tf2_ros.TransformListener`, but checks them.

    tf2 rejects most invalid transforms, but prints two lines on the console each time; some of them crash the process.

    Args:
        buffer: The buffer.
        noted: Called with the child frame of each stored transform.
    """

    def __init__(self, buffer: tf2_ros.Buffer, noted: Callable[[str], None] = lambda _: None) -> None:
        self._noted = noted
        self._warn = ThrottledWarning()
        self._subscribers = [
            rospy.Subscriber(topic, TFMessage, self._on_message, store, queue_size=QUEUE_SIZE)
            for topic, store in (("/tf", buffer.set_transform), ("/tf_static", buffer.set_transform_static))
        ]

    def unregister(self) -> None:
        """Stops listening."""
        for subscriber in self._subscribers:
            subscriber.unregister()

    def _on_message(self, message: TFMessage, store: Callable[[TransformStamped, str], None]) -> None:
        sender = message._connection_header.get("callerid", "")
        for transform in message.transforms:
            fault = fault_in(transform)
            if fault is None:
                store(transform, sender)
                self._noted(transform.child_frame_id)
            else:
                self._warn(f"TF from {sender}", f"'{transform.child_frame_id}' refused: {fault}")


def fault_in(transform: TransformStamped) -> str | None:
    """Returns a description of the fault in a transform, None if it is valid."""
    parent, child = transform.header.frame_id.strip("/"), transform.child_frame_id.strip("/")
    position, quat, stamp = transform.transform.translation, transform.transform.rotation, transform.header.stamp
    if not parent or not child or parent == child:
        return f"expected two frames, got '{parent}' and '{child}'"
    if not 0 <= stamp.secs + stamp.nsecs // NS_PER_S < END_OF_TIME_S:
        return f"expected a stamp before {END_OF_TIME_S} s, got {stamp.secs} s and {stamp.nsecs} ns"
    # A sum is finite only if all of its parts are, unless they are far beyond any scene.
    if not math.isfinite(position.x + position.y + position.z):
        return f"expected a finite translation, got {position.x:g}, {position.y:g}, {position.z:g}"
    norm = quat.x * quat.x + quat.y * quat.y + quat.z * quat.z + quat.w * quat.w
    if not abs(norm - 1.0) < NORM_TOLERANCE:
        return f"expected a quaternion of length 1, got {quat.x:g}, {quat.y:g}, {quat.z:g}, {quat.w:g}"
    return None
