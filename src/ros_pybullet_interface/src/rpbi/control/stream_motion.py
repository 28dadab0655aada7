"""Motion between streamed targets: planned segments, and set points with bounded acceleration that follow the plan."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping
from typing import NamedTuple

from .jitter_buffer import EVERY_TICK, LONGEST_PERIOD_S, SHORTEST, WINDOW
from .sender_clock import STALL_S

BRAKE_S = 0.15
"""Time [s] in which a motion comes to a stop if targets are late."""
HEADROOM = 1.5
"""Ratio of the set points' largest acceleration to the targets' largest acceleration."""
LAST = 6
"""Number of recent targets from whose accelerations the bound is computed."""
FADING = 0.97
"""Factor by which the acceleration bound falls at most per target, while set points deviate from the plan."""
ROUNDING = 1e-9
"""Difference of positions that counts as a rounding error [rad or m]."""


class StreamSegment(NamedTuple):
    """Planned motion of some joints from one target to the next: a cubic Hermite polynomial or a line.

    Attributes:
        start: Start time [ticks].
        length: Duration [ticks].
        goal: Positions [rad or m] at the end of the segment, keyed by joint index.
        way: Displacements [rad or m] from start to end, keyed by joint index.
        slopes: Velocities [rad or m per tick] at start and end, keyed by joint index; None for a line.
        is_beyond: Whether the segment extrapolates beyond the last target because the next target is late.
    """

    start: float
    length: float
    goal: Mapping[int, float]
    way: Mapping[int, float]
    slopes: tuple[Mapping[int, float], Mapping[int, float]] | None = None
    is_beyond: bool = False

    @property
    def end(self) -> float:
        """End time [ticks] of the segment."""
        return self.start + self.length

    def cut(self, tick: float) -> StreamSegment:
        """Returns the part of the segment before a time [ticks]; the part has length 0 if the segment starts later."""
        length = max(tick - self.start, 0.0)
        basis = _hermite(length / self.length)
        way = {index: self.covered(index, basis) for index in self.way}
        goal = {index: value - self.way[index] + way[index] for index, value in self.goal.items()}
        slopes = None if self.slopes is None else (self.slopes[0], self.velocity(tick))
        return self._replace(length=length, goal=goal, way=way, slopes=slopes)

    def covered(self, index: int, basis: tuple[float, float, float]) -> float:
        """Returns the displacement [rad or m] of a joint from the segment's start.

        Args:
            index: Joint index.
            basis: Result of the method `basis`.
        """
        if self.slopes is None:
            return self.way[index] * (basis[0] + basis[1] + basis[2])
        first, last = self.slopes
        return self.way[index] * basis[0] + self.length * (first[index] * basis[1] + last[index] * basis[2])

    def basis(self, tick: float, window: float) -> tuple[float, float, float]:
        """Returns the values of the three Hermite basis functions, averaged over a window of time.

        Args:
            tick: End of the window [ticks].
            window: Length of the window [ticks]; 0 for values at `tick` without averaging.
        """
        share = (tick - self.start) / self.length
        if window <= 0.0:
            return _hermite(share)
        width = window / self.length
        after, before = _hermite_integral(share), _hermite_integral(share - width)
        return (after[0] - before[0]) / width, (after[1] - before[1]) / width, (after[2] - before[2]) / width

    def velocity(self, tick: float) -> Mapping[int, float]:
        """Returns the velocities [rad or m per tick] at a time, keyed by joint index.

        Before the segment, returns the velocities at its start. After the segment, returns the velocities at its end.

        Args:
            tick: The time [ticks].
        """
        if self.slopes is None:
            return {index: way / self.length for index, way in self.way.items()}
        u = min(max((tick - self.start) / self.length, 0.0), 1.0) if self.length else 0.0
        first, last = self.slopes
        ends = {i: (1.0 - u) * (1.0 - 3.0 * u) * first[i] + u * (3.0 * u - 2.0) * last[i] for i in self.way}
        between = 6.0 * u * (1.0 - u) / self.length if self.length else 0.0
        return {index: between * way + ends[index] for index, way in self.way.items()}

    def acceleration_at_end(self) -> Mapping[int, float]:
        """Returns accelerations [rad or m per tick squared] at the segment's end, keyed by joint index."""
        first, last = self.slopes or (self.velocity(self.end),) * 2
        return {
            index: (2.0 * first[index] + 4.0 * last[index] - 6.0 * way / self.length) / self.length
            for index, way in self.way.items()
        }


def _hermite(share: float) -> tuple[float, float, float]:
    """Returns the cubic Hermite basis functions of the displacement, the start velocity and the end velocity.

    Args:
        share: Time as a share of the segment's duration, clipped to 0 ... 1.
    """
    u = min(max(share, 0.0), 1.0)
    rest = 1.0 - u
    return u * u * (3.0 - 2.0 * u), u * rest * rest, -u * u * rest


def _hermite_integral(share: float) -> tuple[float, float, float]:
    """Returns the integrals of the three Hermite basis functions from 0 to `share`."""
    u = min(max(share, 0.0), 1.0)
    square = u * u
    beyond = max(share - 1.0, 0.0)
    return (
        square * u * (1.0 - u / 2.0) + beyond,
        square * (0.5 - u * (2.0 / 3.0 - u / 4.0)),
        square * u * (u / 4.0 - 1.0 / 3.0),
    )


def agree(way: Mapping[int, float], length: float, first: Mapping[int, float], last: Mapping[int, float]) -> bool:
    """Returns whether the velocities of two targets are consistent with the displacement between the targets.

    Zeros, with which many senders fill velocities, are not consistent with a displacement.

    Args:
        way: Displacements [rad or m], keyed by joint index.
        length: Time [ticks] between the targets.
        first: Velocities [rad or m per tick] at the first target, keyed by joint index.
        last: Velocities [rad or m per tick] at the last target, keyed by joint index.
    """
    return all(
        abs(distance - length * (first[index] + last[index]) / 2.0)
        <= length * max(abs(first[index]), abs(last[index])) / 2.0 + 1e-9
        for index, distance in way.items()
    )


class BoundedMotion:
    """Computes set points that follow a plan with bounded acceleration.

    The plan's velocity jumps if targets come late. The set points then leave the plan and rejoin it with bounded
    accelerations. Otherwise set points equal the plan. The bound is computed from the targets and their mean period,
    since delays hardly change the mean period. Decelerations may exceed the bound to stop within `BRAKE_S`.

    Args:
        held: Initial positions [rad or m], keyed by joint index.
        dt_s: Length of a tick [s].
        is_bounded: Whether accelerations are bounded. If not, set points equal the plan.
        limited: Function from a joint index and a position to the position clipped to the joint's limits.

    Attributes:
        brake: Time [ticks] in which a motion comes to a stop.
    """

    def __init__(
        self, held: Mapping[int, float], dt_s: float, is_bounded: bool, limited: Callable[[int, float], float]
    ) -> None:
        self.brake = BRAKE_S / dt_s
        self._is_bounded, self._limited = is_bounded, limited
        self._longest_period, self._longest_stall = LONGEST_PERIOD_S / dt_s, STALL_S / dt_s
        self._arrivals: deque[int] = deque(maxlen=WINDOW)
        self._period = self._elapsed = 0.0
        """Mean interval between recent targets, and interval between the last two targets [ticks]."""
        self._last: deque[Mapping[int, float]] = deque(maxlen=LAST)
        """One mapping per recent target: acceleration bounds [rad or m per tick squared], keyed by joint index."""
        self.restart(held, {})

    def restart(self, positions: Mapping[int, float], velocities: Mapping[int, float]) -> None:
        """Restarts plan and set points.

        Args:
            positions: Positions [rad or m], keyed by joint index.
            velocities: Velocities [rad or m per tick], keyed by joint index; empty for rest.
        """
        self._planned = self._positions = positions
        self._ways: Mapping[int, float] = dict.fromkeys(positions, 0.0)
        self._velocities = velocities or self._ways
        self._apart = 1.0
        """Interval [ticks] between the last two targets."""
        self._last.clear()
        self._bounds: Mapping[int, float] = dict.fromkeys(positions, ROUNDING)

    def jump(self, planned: Mapping[int, float]) -> None:
        """Moves the plan to new positions without moving the set points, which follow with bounded acceleration."""
        self._planned = planned

    def is_under_way(self, tick: int) -> bool:
        """Records the arrival of a target, and returns whether the target continues a motion.

        A target continues a motion within a stream, also after a stall of the stream. Targets that come at every tick
        do not count as a stream.

        Args:
            tick: Number of the first tick after the target came.
        """
        longest = self._longest_stall if any(self._ways.values()) else self._longest_period
        if self._arrivals and tick - self._arrivals[-1] > longest:
            self._arrivals.clear()
        self._elapsed = float(tick - self._arrivals[-1]) if self._arrivals else 0.0
        self._arrivals.append(tick)
        self._period = (tick - self._arrivals[0]) / max(len(self._arrivals) - 1, 1)
        return self._is_bounded and self._period > EVERY_TICK

    def add(self, ways: Mapping[int, float], apart: float, corner: float) -> None:
        """Adds a target, and updates the acceleration bounds.

        Each target's acceleration is estimated from the interval since the previous target, and once more from the
        mean period of recent targets. The smaller estimate is used.

        Args:
            ways: Displacements [rad or m] from the previous target, keyed by joint index.
            apart: Interval [ticks] since the previous target, from stamps; 0 to use the interval between arrivals.
            corner: Duration [ticks] of the plan's velocity change at the previous target; 0 stands for the mean period.
        """
        period = max(self._period, EVERY_TICK)
        apart = apart or max(self._elapsed, EVERY_TICK)
        bounds = {}
        for index, way in ways.items():
            before = self._ways[index]
            by_time = abs(way / apart - before / self._apart) * 2.0 / (apart + self._apart)
            by_period = abs(way - before) / period**2
            change = min(by_time, by_period) * period / (corner or period)
            bounds[index] = max(HEADROOM * change, abs(way) / max(apart, period) / self.brake)
        self._ways, self._apart = ways, apart
        self._last.append(bounds)
        self._bounds = {index: self._bound(index) for index in bounds}

    def _bound(self, index: int) -> float:
        """Returns the new acceleration bound [rad or m per tick squared] of a joint.

        The recent targets determine the bound; if these targets are equal, the bound remains unchanged. While the joint
        deviates from the plan, the bound decreases only slowly.
        """
        latest, before = max(each[index] for each in self._last), self._bounds[index]
        is_off = self._positions[index] != self._planned[index]
        return max(latest, FADING * before) if is_off else latest or before

    def advance(self, planned: Mapping[int, float]) -> Mapping[int, float]:
        """Advances the set points by one tick, and returns the new set points.

        Args:
            planned: Positions [rad or m] of the plan at the end of the tick, keyed by joint index.

        Returns:
            Set points [rad or m] at the end of the tick, keyed by joint index.
        """
        if not self._is_bounded:
            return planned
        positions = {}
        for index, goal in planned.items():
            position, velocity = self._positions[index], self._velocities[index]
            pace, ahead = goal - self._planned[index], position - self._planned[index]
            bound = self._bounds[index] + ROUNDING
            braking = max(bound, abs(velocity) / self.brake)
            fastest = bound * self.brake / SHORTEST
            joining = pace - math.copysign(min(abs(ahead), _stoppable(abs(ahead), bound)), ahead)
            joining = min(max(joining, -fastest), fastest)
            lowest = velocity - (braking if velocity > 0.0 else bound)
            highest = velocity + (bound if velocity > 0.0 else braking)
            position = self._limited(index, position + min(max(joining, lowest), highest))
            positions[index] = goal if abs(position - goal) <= ROUNDING else position
        self._velocities = {index: value - self._positions[index] for index, value in positions.items()}
        self._planned, self._positions = planned, positions
        return positions


def _stoppable(distance: float, bound: float) -> float:
    """Returns the largest displacement in one tick after which a motion can still stop within a distance.

    Args:
        distance: The distance to the stop [rad or m].
        bound: Largest deceleration [rad or m per tick squared].
    """
    return math.sqrt(bound * bound / 4.0 + bound * distance) - bound / 2.0
