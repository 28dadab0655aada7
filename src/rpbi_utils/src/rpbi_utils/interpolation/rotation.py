"""Paths of orientations. Between two knots, the rotation vector relative to the first knot is a polynomial of time.

With a rotation R(t) = exp([phi(t)]) R0, the angular velocity in fixed axes is J(phi) phi'. [phi] is the matrix of the
cross product with phi. J is the left Jacobian J(phi) = 1 + a [phi] + b [phi]^2 with a = (1 - cos |phi|)/|phi|^2 and
b = (|phi| - sin |phi|)/|phi|^3. At phi = 0, J is the identity matrix.
The polynomial phi(t) can meet any orientation, angular velocity and angular acceleration at both ends. The
parametrization has no singular orientation as long as two knots are less than a full turn apart.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from typing import NamedTuple

from robot_model.geometry import (
    ZERO,
    Quaternion,
    Vector,
    cross,
    dot,
    minus,
    norm,
    normalized,
    plus,
    quaternion_of,
    quaternion_product,
    rotation_between,
    scaled,
)
from rpbi.control.trajectories.trajectory import DesiredState, Knot, Trajectory

SMALL_RAD = 1e-3
"""Angle below which series expansions replace the quotients in the Jacobian [rad]."""


class RotationState(NamedTuple):
    """Orientation, angular velocity and angular acceleration at one time.

    Attributes:
        quat_xyzw: Orientation x, y, z, w.
        rate: Angular velocity in fixed axes [rad/s].
        acceleration: Angular acceleration in fixed axes [rad/s^2].
    """

    quat_xyzw: Quaternion
    rate: Vector = ZERO
    acceleration: Vector = ZERO


class RotationKnot(NamedTuple):
    """An orientation that a path passes through.

    Attributes:
        time_s: Time of the knot [s].
        quat_xyzw: Orientation x, y, z, w.
        rate: Angular velocity in fixed axes [rad/s]; None if it is not prescribed.
        acceleration: Angular acceleration in fixed axes [rad/s^2]; None if it is not prescribed.
    """

    time_s: float
    quat_xyzw: Quaternion
    rate: Vector | None = None
    acceleration: Vector | None = None


class RotationSegment(NamedTuple):
    """Part of a path between two successive knots.

    Attributes:
        start_s: Time of the first knot [s].
        base: Orientation of the first knot, x, y, z, w.
        turn: Trajectory of the rotation vector relative to `base`, in fixed axes [rad].
    """

    start_s: float
    base: Quaternion
    turn: Trajectory


class RotationPath:
    """Immutable path of orientations through knots.

    Successive knots are joined by the shorter rotation. The rotation vector is quintic in time if both knots have an
    angular velocity and acceleration, cubic if both have only an angular velocity, and otherwise linear.
    Before the first knot and after the last knot, the orientation is constant.

    Attributes:
        segments: Segments between the knots, in the order of time.
        end_s: Time of the last knot [s].
        goal: Orientation of the last knot, x, y, z, w.
    """

    __slots__ = ("_starts", "end_s", "goal", "segments")

    def __init__(self, segments: Sequence[RotationSegment], end_s: float, goal: Quaternion) -> None:
        self.segments, self.end_s, self.goal = tuple(segments), end_s, goal
        self._starts = tuple(each.start_s for each in segments)

    @classmethod
    def through(cls, knots: Sequence[RotationKnot]) -> RotationPath:
        """Returns the path through one or more knots. Times must increase strictly; quaternions must have norm 1."""
        knots = list(knots)
        for i, after in enumerate(knots[1:]):  # q and -q are the same rotation: avoids jumps of the numbers
            if math.fsum(p * q for p, q in zip(knots[i].quat_xyzw, after.quat_xyzw)) < 0.0:
                x, y, z, w = after.quat_xyzw
                knots[i + 1] = after._replace(quat_xyzw=(-x, -y, -z, -w))
        segments = [_segment(before, after) for before, after in zip(knots, knots[1:])]
        return cls(segments, knots[-1].time_s, knots[-1].quat_xyzw)

    def sample(self, time_s: float) -> RotationState:
        """Returns orientation, angular velocity and angular acceleration at a time [s]."""
        if time_s >= self.end_s or not self.segments:
            return RotationState(self.goal)
        if time_s < self._starts[0]:
            return RotationState(self.segments[0].base)
        segment = self.segments[bisect_right(self._starts, time_s) - 1]
        return _turned(segment.base, segment.turn.sample(time_s))

    def spliced(self, new: RotationPath, at_s: float) -> RotationPath:
        """Returns a path that follows this path until `at_s` [s], and then the path `new`, which begins at `at_s`."""
        kept = [each for each in self.segments if each.start_s < at_s]
        if self.end_s < at_s:
            kept.append(_resting(self.end_s, self.goal, at_s))
        return RotationPath([*kept, *new.segments], new.end_s, new.goal)

    def since(self, time_s: float) -> RotationPath:
        """Returns this path without the segments that end before a time [s]."""
        first = max(bisect_right(self._starts, time_s) - 1, 0)
        return RotationPath(self.segments[first:], self.end_s, self.goal)


def angular_rates(times_s: Sequence[float], quats_xyzw: Sequence[Quaternion]) -> list[Vector]:
    """Estimates smooth angular velocities at K orientations, in fixed axes [rad/s]. They are zero at both ends."""
    h = [after - before for before, after in zip(times_s, times_s[1:])]
    pairs = zip(quats_xyzw, quats_xyzw[1:])
    slopes = [scaled(1.0 / h[i], rotation_between(*pair)) for i, pair in enumerate(pairs)]
    inner = [
        scaled(1.0 / (h[i] + h[i + 1]), plus(scaled(h[i + 1], slopes[i]), scaled(h[i], slopes[i + 1])))
        for i in range(len(slopes) - 1)
    ]
    return [ZERO, *inner, ZERO][: len(quats_xyzw)]


def _segment(before: RotationKnot, after: RotationKnot) -> RotationSegment:
    turn = rotation_between(before.quat_xyzw, after.quat_xyzw)
    start, end = Knot(before.time_s, ZERO), Knot(after.time_s, turn)
    if before.rate is not None and after.rate is not None:
        rate = _without_jacobian(turn, after.rate)
        start, end = start._replace(velocity=before.rate), end._replace(velocity=rate)
        if before.acceleration is not None and after.acceleration is not None:
            bent = _without_jacobian(turn, minus(after.acceleration, _jacobian_rate(turn, rate)))
            start, end = start._replace(acceleration=before.acceleration), end._replace(acceleration=bent)
    return RotationSegment(before.time_s, before.quat_xyzw, Trajectory.through([start, end]))


def _resting(start_s: float, quat_xyzw: Quaternion, end_s: float) -> RotationSegment:
    turn = Trajectory.through([Knot(start_s, ZERO), Knot(end_s, ZERO)])
    return RotationSegment(start_s, quat_xyzw, turn)


def _turned(base: Quaternion, turn: DesiredState) -> RotationState:
    phi, rate, acceleration = (_vector(each) for each in turn)
    quat = normalized(quaternion_product(quaternion_of(phi), base))
    spin = plus(_with_jacobian(phi, acceleration), _jacobian_rate(phi, rate))
    return RotationState(quat, _with_jacobian(phi, rate), spin)


def _vector(values: Sequence[float]) -> Vector:
    x, y, z = values
    return x, y, z


def _with_jacobian(phi: Vector, v: Vector) -> Vector:
    """Returns J(phi) v, where J is the left Jacobian in the module's docstring."""
    a, b, _, _ = _coefficients(norm(phi))
    once = cross(phi, v)
    return plus(v, plus(scaled(a, once), scaled(b, cross(phi, once))))


def _without_jacobian(phi: Vector, v: Vector) -> Vector:
    """Returns J(phi)^-1 v, where J is the left Jacobian in the module's docstring, for |phi| up to pi."""
    angle = norm(phi)
    half = 0.5 * angle
    c = 1.0 / 12.0 if angle < SMALL_RAD else (1.0 - half * math.cos(half) / math.sin(half)) / angle**2
    once = cross(phi, v)
    return plus(v, plus(scaled(-0.5, once), scaled(c, cross(phi, once))))


def _jacobian_rate(phi: Vector, rate: Vector) -> Vector:
    """Returns (dJ(phi)/dt) phi', where J is the left Jacobian in the module's docstring, and phi' is `rate`."""
    _, b, da, db = _coefficients(norm(phi))
    swing = dot(phi, rate)
    once = cross(phi, rate)
    return plus(plus(scaled(da * swing, once), scaled(db * swing, cross(phi, once))), scaled(b, cross(rate, once)))


def _coefficients(angle: float) -> tuple[float, float, float, float]:
    """Returns a and b of the left Jacobian, (da/dx)/x and (db/dx)/x, where x = |phi| is the angle [rad]."""
    square = angle * angle
    if angle < SMALL_RAD:
        return 0.5 - square / 24.0, 1.0 / 6.0 - square / 120.0, -1.0 / 12.0, -1.0 / 60.0
    sin, cos = math.sin(angle), math.cos(angle)
    a, b = (1.0 - cos) / square, (angle - sin) / (square * angle)
    return a, b, (sin / angle - 2.0 * a) / square, ((1.0 - cos) / square - 3.0 * b) / square
