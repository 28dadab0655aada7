"""Set points with bounded acceleration, even if targets come late."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping

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
        """Starts anew at positions, with velocities [rad or m per tick] if there are any."""
        self._planned = self._positions = positions
        self._ways: Mapping[int, float] = dict.fromkeys(positions, 0.0)
        self._velocities = velocities or self._ways
        self._apart = 1.0
        """Time in which the last target was reached from the one before [ticks]."""
        self._last.clear()
        self._bounds: Mapping[int, float] = dict.fromkeys(positions, ROUNDING)

    def jump(self, planned: Mapping[int, float]) -> None:
        """Has the plan continue elsewhere, where set points follow."""
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
            wanted = pace - math.copysign(min(abs(ahead), _stoppable(abs(ahead), bound)), ahead)
            wanted = min(max(wanted, -fastest), fastest)
            lowest = velocity - (braking if velocity > 0.0 else bound)
            highest = velocity + (bound if velocity > 0.0 else braking)
            position = self._limited(index, position + min(max(wanted, lowest), highest))
            positions[index] = goal if abs(position - goal) <= ROUNDING else position
        self._velocities = {index: value - self._positions[index] for index, value in positions.items()}
        self._planned, self._positions = planned, positions
        return positions


def _stoppable(distance: float, bound: float) -> float:
    """Returns the largest way in a tick after which a motion can still stop at a distance."""
    return math.sqrt(bound * bound / 4.0 + bound * distance) - bound / 2.0
