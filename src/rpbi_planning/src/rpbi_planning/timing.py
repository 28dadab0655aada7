"""Timing of paths within limits of velocity, acceleration and jerk, at rest at both ends.

Each joint moves with constant velocity on the straight parts of a path. At each waypoint, the velocities of all joints
change together, with an acceleration that rises, stays and falls linearly in time. The jerk is therefore piecewise
constant, so that velocities, accelerations and jerks take their extremes at known times, and limits are kept exactly.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

Array = np.ndarray
GROWTH = 1.03
"""Factor by which a part of the path becomes slower until the changes of velocity at its ends fit into it."""
CLOSE = 1e-9
"""Waypoints that differ by less than this count as one [rad or m]."""


class PlannedTrajectory:
    """A motion of n joints with piecewise constant jerk, at rest at both ends.

    Args:
        joint_names: Names of the n joints.
        knots: Times at which the jerk changes, k + 1 increasing times from 0 [s].
        states: Positions, velocities and accelerations at the first k knots, and the jerks from there, k x 4 x n.
        end: Positions at the end, shape (n,).

    Attributes:
        times: Sample times [s], shape (m,): all knots, and times between them.
        positions: Positions at the sample times, m x n [rad or m].
        velocities: Velocities, m x n [rad/s or m/s].
        accelerations: Accelerations, m x n [rad/s^2 or m/s^2].
        jerks: Jerks after each sample, m x n [rad/s^3 or m/s^3].
    """

    def __init__(self, joint_names: Sequence[str], knots: Array, states: Array, end: Array) -> None:
        self.joint_names, self._knots, self._states, self._end = tuple(joint_names), knots, states, end
        spaced = np.arange(0.0, self.duration_s, 0.02)
        self.times = np.unique(np.concatenate((knots, spaced))) if len(knots) else np.zeros(1)
        self.positions, self.velocities, self.accelerations, self.jerks = self._sampled(self.times)

    @property
    def duration_s(self) -> float:
        """Duration [s]."""
        return float(self._knots[-1])

    @property
    def duration(self) -> float:
        """The same as `duration_s`, as a `JointMotion` for proofs."""
        return self.duration_s

    def at(self, times: float | Array) -> Array:
        """Returns the positions at one time, shape (n,), or at k times, k x n [rad or m].

        Before the start and after the end, the robot is at rest at the first and at the last position.
        """
        asked = np.atleast_1d(np.asarray(times, float))
        q = self._sampled(asked)[0]
        found: Array = q[0] if np.ndim(times) == 0 else q
        return found

    def velocity_at(self, time: float) -> Array:
        """Returns the velocities at a time, shape (n,) [rad/s or m/s]."""
        velocity: Array = self._sampled(np.array((time,)))[1][0]
        return velocity

    def variation(self, start: Array, end: Array) -> Array:
        """Returns upper bounds on the joint motion between k pairs of times, k x n [rad or m]; see `JointMotion`.

        Between two knots, the velocity of each joint is monotone, so that its largest absolute value is at one of both.
        """
        if len(self._knots) < 2:
            return np.zeros((len(start), len(self._end)))
        speeds = np.abs(np.concatenate((self._states[:, 1], np.zeros((1, len(self._end))))))
        most = np.maximum(speeds[:-1], speeds[1:])
        travelled = np.concatenate((np.zeros((1, len(self._end))), np.cumsum(most * np.diff(self._knots)[:, None], 0)))
        found = []
        for times in (start, end):
            i = np.clip(np.searchsorted(self._knots, times, "right") - 1, 0, len(most) - 1)
            found.append(travelled[i] + most[i] * (times - self._knots[i])[:, None])
        return found[1] - found[0] + 1e-12

    def sampled(self, period_s: float) -> Array:
        """Returns the positions each `period_s`, the end included, m x n [rad or m]."""
        count = int(np.ceil(self.duration_s / period_s - 1e-9))
        return self.at(np.append(np.arange(count) * period_s, self.duration_s))

    def slower(self, factor: float) -> PlannedTrajectory:
        """Returns the same motion with `factor` times the duration."""
        scale = np.array((1.0, factor, factor**2, factor**3))[None, :, None]
        return PlannedTrajectory(self.joint_names, self._knots * factor, self._states / scale, self._end)

    def _sampled(self, times: Array) -> tuple[Array, Array, Array, Array]:
        if len(self._knots) < 2:
            q = np.repeat(self._end[None], len(times), axis=0)
            return q, 0.0 * q, 0.0 * q, 0.0 * q
        i = np.clip(np.searchsorted(self._knots, times, "right") - 1, 0, len(self._states) - 1)
        t = (times - self._knots[i])[:, None]
        q, v, a, j = (self._states[i, row] for row in range(4))
        found = [q + t * (v + t * (a / 2.0 + t * j / 6.0)), v + t * (a + t * j / 2.0), a + t * j, j.copy()]
        for outside, position in ((times <= 0.0, self._states[0, 0]), (times >= self.duration_s, self._end)):
            found[0][outside] = position
            for each in found[1:3]:
                each[outside] = 0.0
            found[3][times >= self.duration_s] = 0.0
        return found[0], found[1], found[2], found[3]


class TimingLimits(NamedTuple):
    """Limits of n joints: velocity, acceleration and jerk, shape (n,) each."""

    velocity: Array
    acceleration: Array
    jerk: Array


class _Blend(NamedTuple):
    """A change of velocity: a ramp of the acceleration, a constant acceleration, and the ramp back.

    Attributes:
        ramp_s: Duration of each ramp [s].
        flat_s: Duration of the constant acceleration [s].
    """

    ramp_s: float
    flat_s: float

    @property
    def duration_s(self) -> float:
        return 2.0 * self.ramp_s + self.flat_s

    @classmethod
    def of(cls, change: Array, limits: TimingLimits) -> _Blend:
        """Returns the shortest blend in which all joints change their velocities by `change` within the limits."""
        size = np.abs(change)
        least, product = float((size / limits.acceleration).max()), float((size / limits.jerk).max())
        if product <= 0.0:
            return cls(0.0, 0.0)
        whole = max(least, product**0.5)  # a ramp and the constant part
        ramp = product / whole
        return cls(ramp, whole - ramp)


class PathTiming:
    """Times a path of straight parts, whose corners are rounded, except where the motion stops.

    Args:
        joint_names: Names of the n joints.
        path: Waypoints, m x n [rad or m]. The motion passes near inner waypoints, and through those at which it stops.
        limits: Limits of the joints.

    Attributes:
        trajectory: The timed motion.
    """

    def __init__(self, joint_names: Sequence[str], path: Array, limits: TimingLimits) -> None:
        self._joint_names, self._path, self._limits = tuple(joint_names), _distinct(path), limits
        self._stops = {0, len(self._path) - 1}
        self._make()

    def stop_near(self, time: float) -> bool:
        """Stops at the rounded corner that is nearest to a time [s]; returns False if no rounded corner is left."""
        rounded = [(abs(at - time), i) for i, at in enumerate(self._corners) if i not in self._stops]
        if not rounded:
            return False
        self._stops.add(min(rounded)[1])
        self._make()
        return True

    def stop_until(self, first_fault: Callable[[PlannedTrajectory], float | None]) -> PlannedTrajectory:
        """Stops at corners until a function finds no fault, or no rounded corner is left; returns the motion.

        Args:
            first_fault: Function that returns the time of a fault of a motion [s]; None if there is none.
        """
        while (time := first_fault(self.trajectory)) is not None and self.stop_near(time):
            pass
        return self.trajectory

    def _make(self) -> None:
        path, ordered = self._path, sorted(self._stops)
        if len(path) < 2:
            nothing = np.empty((0, 4, path.shape[1]))
            self.trajectory, self._corners = PlannedTrajectory(self._joint_names, np.zeros(1), nothing, path[-1]), [0.0]
            return
        parts = [_rounded(path[a : b + 1], self._limits) for a, b in zip(ordered, ordered[1:])]
        self.trajectory, self._corners = _joined(self._joint_names, path, parts)


def _distinct(path: Array) -> Array:
    kept = [path[0]]
    for q in path[1:]:
        if np.abs(q - kept[-1]).max() > CLOSE:
            kept.append(q)
    return np.array(kept)


class _Part(NamedTuple):
    """A motion from one stop to the next: durations between waypoints, velocities between them, and blends at them."""

    spans: Array
    velocities: Array
    blends: list[_Blend]


def _rounded(path: Array, limits: TimingLimits) -> _Part:
    steps = np.diff(path, axis=0)
    spans = (np.abs(steps) / limits.velocity).max(axis=1)
    still = np.zeros((1, path.shape[1]))
    while True:
        velocities = steps / spans[:, None]
        changes = np.diff(np.concatenate((still, velocities, still)), axis=0)
        blends = [_Blend.of(change, limits) for change in changes]
        half = np.array([blend.duration_s / 2.0 for blend in blends])
        short = spans - half[:-1] - half[1:] < -1e-12
        if not short.any():
            return _Part(spans, velocities, blends)
        spans = np.where(short, spans * GROWTH, spans)


def _joined(joint_names: Sequence[str], path: Array, parts: Sequence[_Part]) -> tuple[PlannedTrajectory, list[float]]:
    """Makes one motion of all parts, and returns the times of the waypoints."""
    knots, states, q, now = list[float](), list[Array](), path[0].astype(float), 0.0
    corners, first = list[float](), 0
    for part in parts:
        n = len(q)
        v = np.zeros(n)
        times = now + part.blends[0].duration_s / 2.0 + np.concatenate(((0.0,), np.cumsum(part.spans)))
        corners += times[1 if corners else 0 :].tolist()
        q = path[first].astype(float)
        velocities = np.concatenate((part.velocities, np.zeros((1, n))))
        for number, blend in enumerate(part.blends):
            change = velocities[number] - v
            if blend.duration_s > 0.0:
                peak = change / (blend.ramp_s + blend.flat_s)
                jerk = peak / blend.ramp_s
                for duration, a, j in (
                    (blend.ramp_s, np.zeros(n), jerk),
                    (blend.flat_s, peak, np.zeros(n)),
                    (blend.ramp_s, peak, -jerk),
                ):
                    if duration > 0.0:
                        knots.append(now)
                        states.append(np.array((q, v, a, j)))
                        q = q + duration * (v + duration * (a / 2.0 + duration * j / 6.0))
                        v = v + duration * (a + duration * j / 2.0)
                        now += duration
            v = velocities[number]
            if number < len(part.spans):
                begin_next = times[number + 1] - part.blends[number + 1].duration_s / 2.0
                if begin_next - now > 1e-12:
                    knots.append(now)
                    states.append(np.array((q, v, np.zeros(n), np.zeros(n))))
                    q = q + (begin_next - now) * v
                    now = begin_next
        first += len(part.spans)
    knots.append(now)
    return PlannedTrajectory(joint_names, np.array(knots), np.array(states), path[-1].astype(float)), corners
