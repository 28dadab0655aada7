"""Send times of the targets of a stream: by their stamps, if these run as fast as the world's time."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from typing import NamedTuple

MAX_OFFSET_S = 0.1
"""Largest difference between the times of the last targets by stamps and by arrivals [s]; `DRIFT` comes on top."""
DRIFT = 0.1
"""Largest relative difference of rate between stamps and the world's time."""
STALL_S = 1.0
"""Longest stall of world or sender [s] after which the stamps of what comes at once are still used."""


class Arrival(NamedTuple):
    """A target that came.

    Attributes:
        tick: The tick before which it came.
        stamp_ns: Time of sending by the sender's clock [ns], 0 if unknown.
        goal: Positions by joint index [rad or m].
        step: Number of periods since the target before.
    """

    tick: int
    stamp_ns: int
    goal: Mapping[int, float]
    step: int = 1


class SenderClock:
    """Decides whether the stamps of targets are used.

    Args:
        dt_s: Length of a tick [s].

    Attributes:
        is_right: Whether stamps run as fast as the world's time; None while that is not known. Once they did not, it
            is False until they do for as many targets as are kept.
    """

    def __init__(self, dt_s: float) -> None:
        self._dt_ns = dt_s * 1e9
        self._max_offset = MAX_OFFSET_S / dt_s
        self.is_right: bool | None = None
        self._in_step_ns = 0
        """The last stamp of a full window that ran as fast as the world's time [ns]."""

    def restart(self) -> None:
        """Allows stamps again, since a new stream begins."""
        self.is_right = self.is_right or None

    def ticks_between(self, first_ns: int, last_ns: int) -> float:
        """Returns the time between two stamps [ticks]."""
        return (last_ns - first_ns) / self._dt_ns

    def times(self, seen: deque[Arrival]) -> tuple[list[float], bool]:
        """Returns when targets were sent by their stamps if these are used, else when they came, and which of both.

        Times are counted from the newest target [ticks].

        Args:
            seen: The last targets, in a deque of limited length: a window.
        """
        newest = seen[-1]
        arrivals = [float(each.tick - newest.tick) for each in seen]
        stamps = [self.ticks_between(newest.stamp_ns, each.stamp_ns) for each in seen]
        rises = all(before < after for before, after in zip(stamps, stamps[1:]))
        return (stamps, True) if rises and self._uses(stamps, arrivals, seen) else (arrivals, False)

    def _uses(self, stamps: Sequence[float], arrivals: Sequence[float], seen: deque[Arrival]) -> bool:
        """Returns whether stamps run as fast as the world's time, apart from stalls."""
        is_full = len(seen) == seen.maxlen
        is_in_step = abs(stamps[0] - arrivals[0]) <= self._max_offset - DRIFT * arrivals[0]
        if is_in_step and (is_full or self.is_right is not False):
            if is_full:
                self.is_right, self._in_step_ns = True, seen[-1].stamp_ns
            return True
        if not is_in_step:
            self.is_right = bool(self.is_right) and self._may_have_waited(seen[0].stamp_ns, seen[-1].stamp_ns)
        return bool(self.is_right)

    def _may_have_waited(self, first_ns: int, last_ns: int) -> bool:
        """Returns whether targets that come too fast for their stamps may have waited for the world or the sender.

        That is so until they have left the window.
        """
        return 0 < last_ns - self._in_step_ns <= last_ns - first_ns + STALL_S * 1e9
