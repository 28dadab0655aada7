"""Estimates when streamed targets were sent: from stamps if these are plausible, otherwise from times of arrival."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from typing import NamedTuple

MAX_OFFSET_S = 0.1
"""Largest difference [s] between the window's durations by stamps and by arrivals, in addition to `DRIFT`."""
DRIFT = 0.1
"""Largest relative difference between the rate of stamps and the rate of the world's time."""
STALL_S = 1.0
"""Longest stall [s] of world or sender after which the stamps of targets that arrive in a burst are still used."""


class Arrival(NamedTuple):
    """A received target.

    Attributes:
        tick: Number of the first tick after the target came.
        stamp_ns: Time [ns] of sending by the sender's clock; 0 if unknown.
        goal: Target positions [rad or m], keyed by joint index.
        step: Number of periods of the stream since the previous target.
    """

    tick: int
    stamp_ns: int
    goal: Mapping[int, float]
    step: int = 1


class SenderClock:
    """Decides whether the stamps of targets are used as send times.

    Args:
        dt_s: Length of a tick [s].

    Attributes:
        is_right: Whether stamps run as fast as the world's time; None if unknown. After a deviation, the value is False
            until all stamps in a full window of recent targets agree with the world's time again.
    """

    def __init__(self, dt_s: float) -> None:
        self._dt_ns = dt_s * 1e9
        self._max_offset = MAX_OFFSET_S / dt_s
        self.is_right: bool | None = None
        self._in_step_ns = 0
        """Newest stamp [ns] of the last full window whose stamps ran as fast as the world's time."""

    def restart(self) -> None:
        """Allows the use of stamps again, for a new stream."""
        self.is_right = self.is_right or None

    def ticks_between(self, first_ns: int, last_ns: int) -> float:
        """Returns the time [ticks] between two stamps."""
        return (last_ns - first_ns) / self._dt_ns

    def times(self, seen: deque[Arrival]) -> tuple[list[float], bool]:
        """Returns the estimated send times of targets, and whether these times come from stamps.

        Times [ticks] are relative to the newest target, so they are 0 or negative. Without usable stamps, they are the
        times of arrival.

        Args:
            seen: Window of the newest targets, a deque with a maximum length.
        """
        newest = seen[-1]
        arrivals = [float(each.tick - newest.tick) for each in seen]
        stamps = [self.ticks_between(newest.stamp_ns, each.stamp_ns) for each in seen]
        rises = all(before < after for before, after in zip(stamps, stamps[1:]))
        return (stamps, True) if rises and self._uses(stamps, arrivals, seen) else (arrivals, False)

    def _uses(self, stamps: Sequence[float], arrivals: Sequence[float], seen: deque[Arrival]) -> bool:
        """Returns whether the targets' stamps can be used as send times.

        This is so if the stamps agree with the world's time, or if a stall of the world or the sender explains why the
        stamps do not agree.
        """
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
        """Returns True if a stall, of the world or of the sender, explains why stamps and arrivals disagree.

        A stall is accepted as the explanation until the targets that came after it have left the window of recent
        targets.

        Args:
            first_ns: Oldest stamp [ns] in the window.
            last_ns: Newest stamp [ns] in the window.
        """
        return 0 < last_ns - self._in_step_ns <= last_ns - first_ns + STALL_S * 1e9
