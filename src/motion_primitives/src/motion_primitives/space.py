"""Spaces of motions: n positions, and optionally one orientation.

A point is an array of n positions. In a space with an orientation, a unit quaternion x, y, z, w follows the positions.
A difference between two points has n numbers, followed by a rotation vector if there is an orientation. A velocity has
n numbers, followed by an angular velocity if there is an orientation. Rotation vectors and angular velocities are in
the axes of the fixed frame. So the same formulas hold for positions and orientations.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from custom_ros_tools.transforms import Array, finite_vector
from robot_model.geometry import normalized, quaternion_of, quaternion_product, rotation_between

from .errors import PlanError

QUATERNION = ("qx", "qy", "qz", "qw")
"""Names of an orientation's four numbers."""
POSE = ("x", "y", "z")
"""Names of the three positions of a pose."""
ROUNDING = 1e-12
MIN_NORM, MAX_NORM = 0.9, 1.1
"""Range of quaternion lengths that are accepted and normalised to 1."""


class Space(NamedTuple):
    """Space of a motion's points.

    Attributes:
        names: Names of the n positions.
        has_orientation: Whether points also have an orientation.
    """

    names: tuple[str, ...]
    has_orientation: bool = False

    @property
    def dof(self) -> int:
        """Length of the arrays of differences and velocities: n, or n + 3 with an orientation."""
        return len(self.names) + 3 * self.has_orientation

    @property
    def point_names(self) -> tuple[str, ...]:
        """Names of all numbers of a point: n, or n + 4 with an orientation."""
        return (*self.names, *QUATERNION) if self.has_orientation else self.names

    def point(self, values: ArrayLike, subject: str) -> Array:
        """Checks the numbers of a point, normalises its quaternion, and returns the point.

        Args:
            values: The numbers of the point.
            subject: Name of the point in messages, such as `goal`.

        Raises:
            PlanError: If the count of numbers is wrong, a number is not finite, or the quaternion's length is not
                about 1.
        """
        try:
            point = finite_vector(values, len(self.point_names), subject).copy()
        except (TypeError, ValueError):
            got = str(values).replace("\n", "")
            raise PlanError(
                subject, f"{len(self.point_names)} finite numbers {', '.join(self.point_names)}", got
            ) from None
        if self.has_orientation:
            length = float(np.linalg.norm(point[-4:]))
            if not MIN_NORM <= length <= MAX_NORM:
                raise PlanError(subject, "a quaternion of length 1", f"length {length:.3g}")
            if abs(length - 1.0) > ROUNDING:  # normalising again would change the last bit
                point[-4:] /= length
        return point

    def minus(self, end: Array, start: Array) -> Array:
        """Returns the difference from `start` to `end`, shape (dof,). The rotation takes the shorter way."""
        if not self.has_orientation:
            return end - start
        n = len(self.names)
        rotation = rotation_between(tuple(start[n:].tolist()), tuple(end[n:].tolist()))
        return np.array([*(end[:n] - start[:n]).tolist(), *rotation])

    def plus(self, start: Array, difference: Array) -> Array:
        """Adds a difference, shape (dof,), to the point `start`, and returns the resulting point; inverts `minus`."""
        if not self.has_orientation:
            return start + difference
        n = len(self.names)
        turn = quaternion_of(tuple(difference[n:].tolist()))
        quat = normalized(quaternion_product(turn, tuple(start[n:].tolist())))
        return np.array([*(start[:n] + difference[:n]).tolist(), *quat])

    def shift_rate(self, shift: Array, velocity: Array) -> Array:
        """Converts the velocity of a point to the time derivative of the point's difference, both of shape (dof,).

        They differ for orientations, since the derivative of a rotation vector is not the angular velocity.

        Args:
            shift: Difference from a fixed point to the moving point.
            velocity: Velocity of the moving point.
        """
        n = len(self.names)
        if not self.has_orientation or not shift[n:].any():
            return velocity
        half = 0.5 * float(np.linalg.norm(shift[n:]))
        factor = 1.0 / 12.0 if half < 1e-4 else 0.25 * (1.0 - half / math.tan(half)) / half**2
        around = _cross(shift[n:], velocity[n:])
        turning = velocity[n:] - 0.5 * around + factor * _cross(shift[n:], around)
        return np.concatenate([velocity[:n], turning])

    def rates(self, times: Array, points: Array) -> Array:
        """Computes velocities, shape (m, dof), by finite differences of m points at m times [s]."""
        steps = np.array([self.minus(after, before) for before, after in zip(points, points[1:])])
        path = np.vstack([np.zeros(self.dof), np.cumsum(steps, axis=0)])
        return np.asarray(np.gradient(path, times, axis=0))

    def distance(self, a: Array, b: Array) -> tuple[float, float]:
        """Returns the largest position difference [m or rad] and the angle between orientations [rad] of two points.

        In a space without orientation, the angle is 0.
        """
        difference, n = self.minus(a, b), len(self.names)
        return float(np.abs(difference[:n]).max(initial=0.0)), math.hypot(*difference[n:].tolist())

    def mean(self, points: Sequence[Array]) -> Array:
        """Returns the mean of points; the mean orientation minimises the sum of squared angles."""
        mean = points[0]
        for _ in range(MEAN_ITERATIONS if self.has_orientation else 1):
            mean = self.plus(mean, np.mean([self.minus(each, mean) for each in points], axis=0))
        return mean


MEAN_ITERATIONS = 10
"""Number of iterations to compute the mean of orientations. Each iteration reduces the error by a large factor, unless
orientations are half a turn apart."""


def angular_velocity(rotation: Array, rate: Array) -> Array:
    """Returns the angular velocity [rad/s] of an orientation given by a rotation vector [rad] and its rate [rad/s]."""
    angle = float(np.linalg.norm(rotation))
    small = angle < 1e-4
    first = 0.5 if small else (1.0 - math.cos(angle)) / angle**2
    second = 1.0 / 6.0 if small else (angle - math.sin(angle)) / angle**3
    around = _cross(rotation, rate)
    return np.asarray(rate + first * around + second * _cross(rotation, around))


def turned(rotation: Array, vector: Array) -> Array:
    """Rotates a vector by a rotation vector [rad], with Rodrigues' formula."""
    angle = float(np.linalg.norm(rotation))
    small = angle < 1e-4
    first = 1.0 if small else math.sin(angle) / angle
    second = 0.5 if small else (1.0 - math.cos(angle)) / angle**2
    around = _cross(rotation, vector)
    return np.asarray(vector + first * around + second * _cross(rotation, around))


def _cross(a: Array, b: Array) -> Array:
    (ax, ay, az), (bx, by, bz) = a.tolist(), b.tolist()  # many times faster than numpy's
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])
