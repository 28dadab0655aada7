"""Poses, twists, rotations and vectors as tuples of floats, which are ten times as fast as small NumPy arrays.

Quaternions are in the order x, y, z, w. For conversions to and from matrices and roll, pitch, yaw, see
`custom_ros_tools.transforms`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]

ZERO: Vector = (0.0, 0.0, 0.0)


class Pose(NamedTuple):
    """Pose of a frame in another frame.

    Attributes:
        position: Position x, y, z [m].
        quat_xyzw: Unit quaternion x, y, z, w.
    """

    position: Vector = ZERO
    quat_xyzw: Quaternion = (0.0, 0.0, 0.0, 1.0)

    def __matmul__(self, other: Pose) -> Pose:
        """Chains poses: `pose_b_in_a @ pose_c_in_b` is the pose of c in a."""
        position = plus(self.position, rotated(self.quat_xyzw, other.position))
        return Pose(position, quaternion_product(self.quat_xyzw, other.quat_xyzw))

    def inverse(self) -> Pose:
        """Returns the inverse pose. If this pose is that of b in a, the inverse is the pose of a in b."""
        x, y, z, w = self.quat_xyzw
        return Pose(rotated((-x, -y, -z, w), scaled(-1.0, self.position)), (-x, -y, -z, w))


class Twist(NamedTuple):
    """Linear and angular velocity of a frame.

    Attributes:
        linear: Velocity of the origin along x, y, z [m/s].
        angular: Angular velocity about x, y, z [rad/s].
    """

    linear: Vector = ZERO
    angular: Vector = ZERO

    def seen_from(self, quat_xyzw: Quaternion) -> Twist:
        """Converts the twist to the axes of a frame with the orientation `quat_xyzw`."""
        return Twist(rotated_back(quat_xyzw, self.linear), rotated_back(quat_xyzw, self.angular))


def normalized(quat_xyzw: Sequence[float]) -> Quaternion:
    """Scales a quaternion x, y, z, w to length 1."""
    norm = math.hypot(*quat_xyzw)
    x, y, z, w = (component / norm for component in quat_xyzw)
    return x, y, z, w


def quaternion_product(a: Quaternion, b: Quaternion) -> Quaternion:
    """Returns the product `a b`: the rotation by `b`, followed by the rotation by `a`, both about fixed axes."""
    x, y, z, w = a
    bx, by, bz, bw = b
    return (
        w * bx + x * bw + y * bz - z * by,
        w * by - x * bz + y * bw + z * bx,
        w * bz + x * by - y * bx + z * bw,
        w * bw - x * bx - y * by - z * bz,
    )


def plus(a: Vector, b: Vector) -> Vector:
    """Returns the sum of two vectors."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def minus(a: Vector, b: Vector) -> Vector:
    """Returns the difference of two vectors."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def scaled(factor: float, a: Vector) -> Vector:
    """Multiplies a vector by a number."""
    return factor * a[0], factor * a[1], factor * a[2]


def dot(a: Vector, b: Vector) -> float:
    """Returns the scalar product of two vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    """Returns the cross product of two vectors."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def norm(a: Vector) -> float:
    """Returns the length of a vector."""
    return math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])


def shortened_to(a: Vector, length: float) -> Vector:
    """Scales a vector down to the length `length`; returns shorter vectors unchanged."""
    now = norm(a)
    return a if now <= length else scaled(length / now, a)


def turned_about_z(a: Vector, yaw: float) -> Vector:
    """Rotates a vector about z by the angle `yaw` [rad]."""
    cos, sin = math.cos(yaw), math.sin(yaw)
    return cos * a[0] - sin * a[1], sin * a[0] + cos * a[1], a[2]


def rotated(quat_xyzw: Quaternion, a: Vector) -> Vector:
    """Rotates a vector by a quaternion, which converts the vector from a frame's axes to the parent frame's axes."""
    x, y, z, w = quat_xyzw
    tx, ty, tz = cross((2.0 * x, 2.0 * y, 2.0 * z), a)
    cx, cy, cz = cross((x, y, z), (tx, ty, tz))
    return a[0] + w * tx + cx, a[1] + w * ty + cy, a[2] + w * tz + cz


def rotated_back(quat_xyzw: Quaternion, a: Vector) -> Vector:
    """Rotates a vector by the inverse quaternion, which converts it from the parent frame's axes to a frame's axes."""
    x, y, z, w = quat_xyzw
    return rotated((-x, -y, -z, w), a)


def quaternion_of(rotation: Vector) -> Quaternion:
    """Converts a rotation vector [rad] to a quaternion x, y, z, w."""
    angle = math.hypot(*rotation)
    x, y, z = scaled(0.5 if angle < 1e-9 else math.sin(angle / 2.0) / angle, rotation)
    return x, y, z, math.cos(angle / 2.0)


def angle_between(start: Quaternion, end: Quaternion) -> float:
    """Returns the angle between two orientations, from 0 to pi [rad]; q and -q are the same orientation."""
    return norm(rotation_between(start, end))


def rotation_between(start: Quaternion, end: Quaternion) -> Vector:
    """Returns the rotation vector [rad] of the shorter rotation from `start` to `end`, about fixed axes."""
    w0, w1 = start[3], end[3]
    v0, v1 = start[:3], end[:3]
    x, y, z = minus(minus(scaled(w0, v1), scaled(w1, v0)), cross(v1, v0))
    w = w0 * w1 + dot(v0, v1)
    sine = math.hypot(x, y, z)
    angle = 2.0 * math.atan2(sine, abs(w))
    return scaled(math.copysign(angle / sine if sine > 1e-12 else 2.0, w), (x, y, z))
