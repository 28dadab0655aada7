"""Poses and twists of the simulator, with PyBullet's arithmetic, and loads on links.

PyBullet chains poses and turns vectors in single precision. The results of a simulation depend on it to the last bit,
so PyBullet also chains a pose of this module with one of `robot_model.geometry`.
"""

from __future__ import annotations

from typing import NamedTuple

import pybullet

from robot_model import geometry
from robot_model.geometry import Quaternion, Vector


class Pose(geometry.Pose):
    """Pose of a frame in another, see `robot_model.geometry.Pose`."""

    __slots__ = ()

    def __matmul__(self, other: geometry.Pose) -> Pose:
        """Chains poses: `pose_b_in_a @ pose_c_in_b` is the pose of c in a."""
        return Pose(*pybullet.multiplyTransforms(*self, *other))

    def __rmatmul__(self, other: geometry.Pose) -> Pose:
        return Pose(*pybullet.multiplyTransforms(*other, *self))

    def inverse(self) -> Pose:
        """Returns the pose of the other frame in this one."""
        return Pose(*pybullet.invertTransform(*self))


class Twist(geometry.Twist):
    """Velocity of a frame's origin and rotation of the frame, see `robot_model.geometry.Twist`."""

    __slots__ = ()

    def seen_from(self, quat_xyzw: Quaternion) -> Twist:
        """Returns the same twist in the axes of a frame of that orientation."""
        return Twist(rotated_back(quat_xyzw, self.linear), rotated_back(quat_xyzw, self.angular))


class LinkWrench(NamedTuple):
    """A force and a torque on a link, in the axes of the world.

    Attributes:
        link: PyBullet's index of the link, -1 for the base.
        force: Force [N].
        torque: Torque [N m].
        point: Where the force acts, in the world [m].
    """

    link: int
    force: Vector
    torque: Vector
    point: Vector


def rotated(quat_xyzw: Quaternion, a: Vector) -> Vector:
    """Returns a vector of a frame of that orientation in the axes of the frame around it."""
    result: Vector = pybullet.rotateVector(quat_xyzw, a)
    return result


def rotated_back(quat_xyzw: Quaternion, a: Vector) -> Vector:
    """Returns a vector in the axes of a frame of that orientation."""
    x, y, z, w = quat_xyzw
    return rotated((-x, -y, -z, w), a)
