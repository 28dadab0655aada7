"""Converts transform messages to and from vectors, and publishes a transform on /tf repeatedly."""

import rospy
from geometry_msgs.msg import Point, Pose, Quaternion, Transform, TransformStamped, Vector3
from numpy.typing import ArrayLike
from tf2_msgs.msg import TFMessage

from custom_ros_tools.transforms import Array, finite_vector, quat_of, unit_quat


def transform_message(position: ArrayLike, orientation: ArrayLike, in_deg: bool = False) -> Transform:
    """Makes a Transform message.

    Args:
        position: Position x, y, z [m].
        orientation: Quaternion x, y, z, w, or roll, pitch, yaw.
        in_deg: Whether roll, pitch, yaw are in degrees instead of radians.

    Raises:
        ValueError: If the count of numbers is wrong, a number is not finite, or the quaternion is zero.
    """
    translation = Vector3(*finite_vector(position, 3, "position").tolist())
    return Transform(translation, Quaternion(*quat_of(orientation, in_deg).tolist()))


def position_in(transform: Transform) -> Array:
    """Returns the translation x, y, z of a message [m]; raises a ValueError if a number is not finite."""
    v = transform.translation
    return finite_vector((v.x, v.y, v.z), 3, "position")


def quat_in(transform: Transform) -> Array:
    """Returns the rotation of a message as a unit quaternion x, y, z, w.

    Raises:
        ValueError: If the quaternion is zero, or a number is not finite.
    """
    q = transform.rotation
    return unit_quat((q.x, q.y, q.z, q.w))


def as_pose(transform: Transform) -> Pose:
    """Converts a Transform message to a Pose message."""
    v = transform.translation
    return Pose(Point(v.x, v.y, v.z), transform.rotation)


class TransformTopic:
    """Publishes the transform between two frames on /tf, with the current ROS time as stamp.

    A message that equals the last message, also in its stamp, is not published, since a repeated stamp makes TF
    listeners log warnings. Stamps are repeated while simulated time is stopped. The topic is latched, so that new
    subscribers get the last message.

    Args:
        parent: Name of the parent frame.
        child: Name of the child frame.
    """

    def __init__(self, parent: str, child: str) -> None:
        self._parent, self._child = parent, child
        self._last: TransformStamped | None = None
        self._publisher = rospy.Publisher("/tf", TFMessage, latch=True, queue_size=10)

    def send(self, transform: Transform) -> rospy.Time:
        """Publishes the child's pose in the parent frame, unless the message is a repetition, and returns the stamp."""
        message = TransformStamped(child_frame_id=self._child, transform=transform)
        message.header.frame_id = self._parent
        message.header.stamp = rospy.Time.now()
        if message != self._last:
            self._last = message
            self._publisher.publish(TFMessage([message]))
        return message.header.stamp
