"""Poses, twists and wrenches of the simulator, computed by PyBullet.

PyBullet multiplies poses and rotates vectors in single precision, and simulations depend on the rounding of the
results. A product of poses is therefore computed by PyBullet if at least one pose is a `Pose` of this module.
"""

from __future__ import annotations

from typing import NamedTuple

import pybullet

from robot_model import geometry
from robot_model.geometry import Quaternion, Vector


class Pose(geometry.Pose):
    """Pose of one frame in another frame, see `robot_model.geometry.Pose`."""

    __slots__ = ()

    def __matmul__(self, other: geometry.Pose) -> Pose:
        """Returns the product of two poses: `pose_b_in_a @ pose_c_in_b` is the pose of c in a."""
        return Pose(*pybullet.multiplyTransforms(*self, *other))

    def __rmatmul__(self, other: geometry.Pose) -> Pose:
        return Pose(*pybullet.multiplyTransforms(*other, *self))

    def inverse(self) -> Pose:
        """Returns the inverse pose: the inverse of `pose_b_in_a` is the pose of a in b."""
        return Pose(*pybullet.invertTransform(*self))


class Twist(geometry.Twist):
    """Linear velocity of a frame's origin and angular velocity of the frame, see `robot_model.geometry.Twist`."""

    __slots__ = ()

    def seen_from(self, quat_xyzw: Quaternion) -> Twist:
        """Returns the twist expressed in the axes of a rotated frame.

        Args:
            quat_xyzw: Orientation of the rotated frame, in the axes in which the twist is given.
        """
        return Twist(rotated_back(quat_xyzw, self.linear), rotated_back(quat_xyzw, self.angular))


class LinkWrench(NamedTuple):
    """A force and a torque on a link, in the axes of the world.

    Attributes:
        link: PyBullet's index of the link, -1 for the base.
        force: Force [N].
        torque: Torque [N m].
        point: Point of application, in the world frame [m].
    """

    link: int
    force: Vector
    torque: Vector
    point: Vector


def rotated(quat_xyzw: Quaternion, a: Vector) -> Vector:
    """Converts a vector from the axes of a frame with orientation `quat_xyzw` to the axes of the parent frame."""
    result: Vector = pybullet.rotateVector(quat_xyzw, a)
    return result


def rotated_back(quat_xyzw: Quaternion, a: Vector) -> Vector:
    """Converts a vector from the axes of the parent frame to the axes of a frame with orientation `quat_xyzw`."""
    x, y, z, w = quat_xyzw
    return rotated((-x, -y, -z, w), a)
