"""Transforms as messages: conversions from and to vectors, and a topic that repeats one on /tf."""

import rospy
from geometry_msgs.msg import Point, Pose, Quaternion, Transform, TransformStamped, Vector3
from numpy.typing import ArrayLike
from tf2_msgs.msg import TFMessage

from custom_ros_tools.transforms import Array, finite_vector, quat_of, unit_quat


def transform_message(position: ArrayLike, orientation: ArrayLike, in_deg: bool = False) -> Transform:
    """Returns a message.

    Args:
        position: x, y, z [m].
        orientation: Quaternion x, y, z, w, or roll, pitch, yaw.
        in_deg: Whether roll, pitch, yaw are in degrees rather than radians.

    Raises:
        ValueError: If lengths are wrong, a number is not finite or the quaternion is zero.
    """
    translation = Vector3(*finite_vector(position, 3, "position").tolist())
    return Transform(translation, Quaternion(*quat_of(orientation, in_deg).tolist()))


def position_in(transform: Transform) -> Array:
    """Returns the translation x, y, z [m]; raises a ValueError if a number is not finite."""
    v = transform.translation
    return finite_vector((v.x, v.y, v.z), 3, "position")


def quat_in(transform: Transform) -> Array:
    """Returns the rotation as a unit quaternion x, y, z, w; raises a ValueError if it is zero or not finite."""
    q = transform.rotation
    return unit_quat((q.x, q.y, q.z, q.w))


def as_pose(transform: Transform) -> Pose:
    """Returns the transform as a pose message."""
    v = transform.translation
    return Pose(Point(v.x, v.y, v.z), transform.rotation)


class TransformTopic:
    """Sends the transform between two frames to /tf with the present stamp, unless neither transform nor stamp has
    changed.

    While simulated time is stopped, a repeated stamp would make each listener warn. New subscribers get the last
    message, since the topic is latched.
    """

    def __init__(self, parent: str, child: str) -> None:
        self._parent, self._child = parent, child
        self._last: TransformStamped | None = None
        self._publisher = rospy.Publisher("/tf", TFMessage, latch=True, queue_size=10)

    def send(self, transform: Transform) -> rospy.Time:
        """Sends the present pose of the child in the parent, and returns its stamp."""
        message = TransformStamped(child_frame_id=self._child, transform=transform)
        message.header.frame_id = self._parent
        message.header.stamp = rospy.Time.now()
        if message != self._last:
            self._last = message
            self._publisher.publish(TFMessage([message]))
        return message.header.stamp
