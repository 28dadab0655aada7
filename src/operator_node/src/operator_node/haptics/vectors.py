"""What force feedback does with vectors beside `rpbi.geometry`; plain floats, a tenth as slow as arrays at 1 kHz."""

import math

from rpbi.geometry import Vector, scaled

ZERO: Vector = (0.0, 0.0, 0.0)


def norm(a: Vector) -> float:
    """Returns the length."""
    return math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])


def within(a: Vector, most: float) -> Vector:
    """Returns a, shortened if it is longer than `most`."""
    length = norm(a)
    return a if length <= most else scaled(most / length, a)


def turned(a: Vector, yaw: float) -> Vector:
    """Returns a, turned about z by an angle [rad]."""
    cos, sin = math.cos(yaw), math.sin(yaw)
    return cos * a[0] - sin * a[1], sin * a[0] + cos * a[1], a[2]
