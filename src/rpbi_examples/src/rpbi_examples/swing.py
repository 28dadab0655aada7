"""A motion that shows every joint of a robot: one after the other swings out and back."""

from __future__ import annotations

import math
from collections.abc import Sequence

TO_ZERO_S = 3.0
"""Time that all joints take together to reach zero [s]."""
PERIOD_S = 4.0
"""Time that one joint swings [s]."""
AMPLITUDE = 1.0
"""How far it swings to either side [rad or m]; less where its limits ask for it."""
MARGIN = 0.95
"""Share of the way to a limit that is used."""


class Swing:
    """Positions of all joints over time.

    Args:
        start: Where the n joints are at time 0 [rad or m].
        lower: Their lower limits; -inf where there is none.
        upper: Their upper limits.
    """

    def __init__(self, start: Sequence[float], lower: Sequence[float], upper: Sequence[float]) -> None:
        self._start = tuple(start)
        self._zero = tuple(min(max(0.0, low), high) for low, high in zip(lower, upper, strict=True))
        self._amplitude = tuple(
            max(0.0, min(AMPLITUDE, MARGIN * (high - zero), MARGIN * (zero - low)))
            for zero, low, high in zip(self._zero, lower, upper, strict=True)
        )
        forth = list(range(len(self._start)))
        self._order = forth + forth[-2:0:-1]

    def at(self, time_s: float) -> tuple[float, ...]:
        """Returns the positions of the n joints at a time since the start [s]."""
        if time_s < TO_ZERO_S:
            share = _minimum_jerk(time_s / TO_ZERO_S)
            return tuple(start + share * (zero - start) for start, zero in zip(self._start, self._zero, strict=True))
        turn, phase_s = divmod(time_s - TO_ZERO_S, PERIOD_S)
        joint = self._order[int(turn) % len(self._order)]
        positions = list(self._zero)
        positions[joint] += self._amplitude[joint] * math.sin(2.0 * math.pi * phase_s / PERIOD_S)
        return tuple(positions)


def _minimum_jerk(share: float) -> float:
    """Returns how much of a way is done after a share of its time (Flash and Hogan, 1985)."""
    return share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
