"""Motion between the targets of a stream: segments of a plan, and set points of bounded acceleration."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping
from typing import NamedTuple

from .jitter_buffer import EVERY_TICK, LONGEST_PERIOD_S, SHORTEST, WINDOW
from .sender_clock import STALL_S

BRAKE_S = 0.15
"""Time in which a motion comes to a stop when targets are late [s]."""
HEADROOM = 1.5
"""Ratio of the largest acceleration of set points to that of the targets."""
LAST = 6
"""Number of targets whose accelerations count."""
FADING = 0.97
"""Share of the bound that is left at the next target while set points are off the plan, though targets hardly move."""
ROUNDING = 1e-9
"""Difference of positions that is an error of rounding [rad or m]."""


class StreamSegment(NamedTuple):
    """The motion of some joints from one target to the next: a cubic Hermite spline, or a line.

    Attributes:
        start: Time of its beginning [ticks].
        length: Duration [ticks].
        goal: Positions at its end by joint index [rad or m].
        way: Distances from its beginning by joint index [rad or m].
        slopes: Velocities at both ends by joint index [rad or m per tick], None if it is a line.
        is_beyond: Whether it goes beyond the last target because the next one is late.
    """

    start: float
    length: float
    goal: Mapping[int, float]
    way: Mapping[int, float]
    slopes: tuple[Mapping[int, float], Mapping[int, float]] | None = None
    is_beyond: bool = False

    @property
    def end(self) -> float:
        """Time of its goal [ticks]."""
        return self.start + self.length

    def cut(self, tick: float) -> StreamSegment:
        """Returns its part before a time; of length 0 if that is empty."""
        length = max(tick - self.start, 0.0)
        basis = _hermite(length / self.length)
        way = {index: self.covered(index, basis) for index in self.way}
        goal = {index: value - self.way[index] + way[index] for index, value in self.goal.items()}
        slopes = None if self.slopes is None else (self.slopes[0], self.velocity(tick))
        return self._replace(length=length, goal=goal, way=way, slopes=slopes)

    def covered(self, index: int, basis: tuple[float, float, float]) -> float:
        """Returns the displacement of a joint for the values, or averages, of the basis functions."""
        if self.slopes is None:
            return self.way[index] * (basis[0] + basis[1] + basis[2])
        first, last = self.slopes
        return self.way[index] * basis[0] + self.length * (first[index] * basis[1] + last[index] * basis[2])

    def basis(self, tick: float, window: float) -> tuple[float, float, float]:
        """Returns the basis functions at a time, averaged over the window before it [ticks]."""
        share = (tick - self.start) / self.length
        if window <= 0.0:
            return _hermite(share)
        width = window / self.length
        after, before = _hermite_integral(share), _hermite_integral(share - width)
        return (after[0] - before[0]) / width, (after[1] - before[1]) / width, (after[2] - before[2]) / width

    def velocity(self, tick: float) -> Mapping[int, float]:
        """Returns the velocities by joint index at a time [rad or m per tick], outside of it those at its ends."""
        if self.slopes is None:
            return {index: way / self.length for index, way in self.way.items()}
        u = min(max((tick - self.start) / self.length, 0.0), 1.0) if self.length else 0.0
        first, last = self.slopes
        ends = {i: (1.0 - u) * (1.0 - 3.0 * u) * first[i] + u * (3.0 * u - 2.0) * last[i] for i in self.way}
        between = 6.0 * u * (1.0 - u) / self.length if self.length else 0.0
        return {index: between * way + ends[index] for index, way in self.way.items()}

    def acceleration_at_end(self) -> Mapping[int, float]:
        """Returns the accelerations at its end by joint index [rad or m per tick squared]."""
        first, last = self.slopes or (self.velocity(self.end),) * 2
        return {
            index: (2.0 * first[index] + 4.0 * last[index] - 6.0 * way / self.length) / self.length
            for index, way in self.way.items()
        }


def _hermite(share: float) -> tuple[float, float, float]:
    """Returns the cubic Hermite basis of the way and of the slopes at both ends, constant before 0 and after 1."""
    u = min(max(share, 0.0), 1.0)
    rest = 1.0 - u
    return u * u * (3.0 - 2.0 * u), u * rest * rest, -u * u * rest


def _hermite_integral(share: float) -> tuple[float, float, float]:
    """Returns the integrals of the Hermite basis from 0."""
    u = min(max(share, 0.0), 1.0)
    square = u * u
    beyond = max(share - 1.0, 0.0)
    return (
        square * u * (1.0 - u / 2.0) + beyond,
        square * (0.5 - u * (2.0 / 3.0 - u / 4.0)),
        square * u * (u / 4.0 - 1.0 / 3.0),
    )


def agree(way: Mapping[int, float], length: float, first: Mapping[int, float], last: Mapping[int, float]) -> bool:
    """Returns whether velocities fit the displacement; many senders fill them with zeros."""
    return all(
        abs(distance - length * (first[index] + last[index]) / 2.0)
        <= length * max(abs(first[index]), abs(last[index])) / 2.0 + 1e-9
        for index, distance in way.items()
    )


class BoundedMotion:
    """Follows a planned motion, exactly where it accelerates no more than its targets.

    A plan changes its velocity at once when late targets come. Set points then leave it, and join it again by bounded
    accelerations. The bound comes from the targets and their mean period, which no delay changes much; a motion may
    always brake within `BRAKE_S`.

    Args:
        held: Positions by joint index [rad or m].
        dt_s: Length of a tick [s].
        is_bounded: Whether accelerations are bounded; if not, the plan is followed exactly.
        limited: Returns a position of a joint by index within its limits.

    Attributes:
        brake: Time in which a motion comes to a stop [ticks].
    """

    def __init__(
        self, held: Mapping[int, float], dt_s: float, is_bounded: bool, limited: Callable[[int, float], float]
    ) -> None:
        self.brake = BRAKE_S / dt_s
        self._is_bounded, self._limited = is_bounded, limited
        self._longest_period, self._longest_stall = LONGEST_PERIOD_S / dt_s, STALL_S / dt_s
        self._arrivals: deque[int] = deque(maxlen=WINDOW)
        self._period = self._elapsed = 0.0
        """Mean time between the last targets, and time between the last two [ticks]."""
        self._last: deque[Mapping[int, float]] = deque(maxlen=LAST)
        """Bounds of acceleration by the last targets by joint index [rad or m per tick squared]."""
        self.restart(held, {})

    def restart(self, positions: Mapping[int, float], velocities: Mapping[int, float]) -> None:
        """Starts again at positions, with velocities [rad or m per tick] if there are any."""
        self._planned = self._positions = positions
        self._ways: Mapping[int, float] = dict.fromkeys(positions, 0.0)
        self._velocities = velocities or self._ways
        self._apart = 1.0
        """Time in which the last target was reached from the one before [ticks]."""
        self._last.clear()
        self._bounds: Mapping[int, float] = dict.fromkeys(positions, ROUNDING)

    def jump(self, planned: Mapping[int, float]) -> None:
        """Lets the plan continue at other positions; set points follow with bounded acceleration."""
        self._planned = planned

    def is_under_way(self, tick: int) -> bool:
        """Returns whether a target that comes before a tick continues a motion, and notes its arrival.

        That is so within a stream, and after a stall in its midst. Targets at every tick are no such stream.
        """
        longest = self._longest_stall if any(self._ways.values()) else self._longest_period
        if self._arrivals and tick - self._arrivals[-1] > longest:
            self._arrivals.clear()
        self._elapsed = float(tick - self._arrivals[-1]) if self._arrivals else 0.0
        self._arrivals.append(tick)
        self._period = (tick - self._arrivals[0]) / max(len(self._arrivals) - 1, 1)
        return self._is_bounded and self._period > EVERY_TICK

    def add(self, ways: Mapping[int, float], apart: float, corner: float) -> None:
        """Adds a target.

        Its acceleration is the smaller one of two: by the time from the target before, and by the mean period.

        Args:
            ways: Distances from the target before by joint index [rad or m].
            apart: Time from the target before by their stamps [ticks], 0 for the time between their arrivals.
            corner: Time in which the velocity before changes to that after it [ticks], 0 for the period.
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
        """Returns the bound of a joint, which fades slowly while the joint is off its plan, and stays at rest."""
        latest, before = max(each[index] for each in self._last), self._bounds[index]
        is_off = self._positions[index] != self._planned[index]
        return max(latest, FADING * before) if is_off else latest or before

    def advance(self, planned: Mapping[int, float]) -> Mapping[int, float]:
        """Advances by a tick, after which the plan is at positions, and returns those of the motion by joint index."""
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
    """Returns the largest way in a tick after which a motion can still stop at a distance."""
    return math.sqrt(bound * bound / 4.0 + bound * distance) - bound / 2.0
