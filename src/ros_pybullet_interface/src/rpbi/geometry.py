"""Poses, twists and vectors."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import pybullet

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


class Pose(NamedTuple):
    """Pose of a frame in another.

    Attributes:
        position: x, y, z [m].
        quat_xyzw: Unit quaternion x, y, z, w.
    """

    position: Vector = (0.0, 0.0, 0.0)
    quat_xyzw: Quaternion = (0.0, 0.0, 0.0, 1.0)

    def __matmul__(self, other: Pose) -> Pose:
        """Chains poses: `pose_b_in_a @ pose_c_in_b` is the pose of c in a."""
        return Pose(*pybullet.multiplyTransforms(*self, *other))

    def inverse(self) -> Pose:
        """Returns the pose of the other frame in this one."""
        return Pose(*pybullet.invertTransform(*self))


class Load(NamedTuple):
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


def normalized(quat_xyzw: Sequence[float]) -> Quaternion:
    """Returns the unit quaternion of the same rotation."""
    norm = math.hypot(*quat_xyzw)
    x, y, z, w = (component / norm for component in quat_xyzw)
    return x, y, z, w


def plus(a: Vector, b: Vector) -> Vector:
    """Returns the sum of two vectors."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def minus(a: Vector, b: Vector) -> Vector:
    """Returns the difference of two vectors."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def scaled(factor: float, a: Vector) -> Vector:
    """Returns a vector times a number."""
    return factor * a[0], factor * a[1], factor * a[2]


def dot(a: Vector, b: Vector) -> float:
    """Returns the scalar product of two vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    """Returns the cross product of two vectors."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def rotated(quat_xyzw: Quaternion, a: Vector) -> Vector:
    """Returns a vector of a frame of that orientation in the axes of what the frame is in."""
    result: Vector = pybullet.rotateVector(quat_xyzw, a)
    return result


def rotated_back(quat_xyzw: Quaternion, a: Vector) -> Vector:
    """Returns a vector in the axes of a frame of that orientation."""
    x, y, z, w = quat_xyzw
    return rotated((-x, -y, -z, w), a)


def rotation_between(start: Quaternion, end: Quaternion) -> Vector:
    """Returns the rotation vector [rad] that leads from one orientation to another, the shorter way."""
    w0, w1 = start[3], end[3]
    v0, v1 = start[:3], end[:3]
    x, y, z = minus(minus(scaled(w0, v1), scaled(w1, v0)), cross(v1, v0))
    w = w0 * w1 + dot(v0, v1)
    sine = math.hypot(x, y, z)
    angle = 2.0 * math.atan2(sine, abs(w))
    return scaled(math.copysign(angle / sine if sine > 1e-12 else 2.0, w), (x, y, z))


class Twist(NamedTuple):
    """Velocity of a frame's origin and rotation of the frame.

    Attributes:
        linear: x, y, z [m/s].
        angular: About x, y, z [rad/s].
    """

    linear: Vector = (0.0, 0.0, 0.0)
    angular: Vector = (0.0, 0.0, 0.0)

    def seen_from(self, quat_xyzw: Quaternion) -> Twist:
        """Returns the same twist in the axes of a frame of that orientation."""
        return Twist(rotated_back(quat_xyzw, self.linear), rotated_back(quat_xyzw, self.angular))
