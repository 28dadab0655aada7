"""Arithmetic of vectors of three numbers, for which plain tuples are several times as fast as NumPy."""

from __future__ import annotations

import pybullet

from .pose import Quaternion, Vector


def plus(a: Vector, b: Vector) -> Vector:
    """Returns the sum of two vectors."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def minus(a: Vector, b: Vector) -> Vector:
    """Returns the difference of two vectors."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def scaled(factor: float, a: Vector) -> Vector:
    """Returns a vector times a number."""
    return factor * a[0], factor * a[1], factor * a[2]


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
