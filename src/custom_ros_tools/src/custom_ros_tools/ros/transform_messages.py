"""Transforms between ROS messages and vectors."""

from __future__ import annotations

from geometry_msgs.msg import Point, Pose, Quaternion, Transform, Vector3
from numpy.typing import ArrayLike

from custom_ros_tools.transforms import Array, finite_vector, quat_of, unit_quat


def transform_message(position: ArrayLike, orientation: ArrayLike, in_deg: bool = False) -> Transform:
    """Return a message.

    Args:
        position: x, y, z [m].
        orientation: Quaternion x, y, z, w, or roll, pitch, yaw.
        in_deg: Whether roll, pitch, yaw are in degrees rather than radians.

    Raises:
        ValueError: If lengths are wrong, a number is not finite or the quaternion is zero.
    """
    translation = Vector3(*finite_vector(position, 3, "position").tolist())
    return Transform(translation, Quaternion(*quat_of(orientation, in_deg).tolist()))


def checked(transform: Transform) -> Transform:
    """Return a transform that came from outside, its quaternion normalised.

    Raises:
        ValueError: If a number is not finite or the quaternion is zero.
    """
    return transform_message(position_in(transform), quat_in(transform))


def position_in(transform: Transform) -> Array:
    """Return the translation x, y, z [m]."""
    v = transform.translation
    return finite_vector((v.x, v.y, v.z), 3, "position")


def quat_in(transform: Transform) -> Array:
    """Return the rotation as a unit quaternion x, y, z, w."""
    q = transform.rotation
    return unit_quat((q.x, q.y, q.z, q.w))


def as_pose(transform: Transform) -> Pose:
    """Return the same as a pose message."""
    v = transform.translation
    return Pose(Point(v.x, v.y, v.z), transform.rotation)
