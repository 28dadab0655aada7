"""Playout times of the targets of a stream: a jitter buffer."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from .sender_clock import DRIFT, Arrival, SenderClock

BUFFER_S = 0.02
"""Default delay in which late targets are still in time [s]."""
LONGEST_PERIOD_S = 0.2
"""Targets that are farther apart than this [s] are no stream: each acts at once."""
EVERY_TICK = 1.5
"""Targets that are no farther apart than this many ticks act at once, too."""
WINDOW = 64
"""Number of arrivals from which period, rate and delay are estimated."""
SETTLING_S = 0.8
"""Time constant of changes of the delay [s], shorter for the first targets."""
SHORTEST = 0.8
"""A target is played no sooner after the one before than this share of the time between them."""
REPLACED = 0.25
"""A target that was sent sooner than this share of the period after another one replaces it."""
MIN_MISFIT_RATIO = 2.0
"""Ratio of excess squared misfits above which a regular period replaces stamps, or the reverse."""
MIN_MISFIT = 1e-10
"""Squared misfit below which candidates count as equal [rad^2 or m^2]."""
MIN_LOSS_RATIO = 16.0
"""Ratio of squared misfits above which a gap counts as lost targets rather than as a late one."""
MAX_LOST = 4
"""Longest gap that can count as lost targets [periods]."""
PERSISTENT = 16
"""Number of targets out of step in a row after which only these count."""
SAME_PERIOD = (0.6, 1.6)
"""Range of the mean of the last `PERSISTENT` intervals within which the period has not changed [periods]."""
SHORTEST_WAY = 0.05
"""Least time from one target to the next as they are played [ticks]."""
LEAST_AHEAD = 0.25
"""Smallest delay between arrival and playing of a target [ticks]."""


class Playout(NamedTuple):
    """When to play a target.

    Attributes:
        start: When to leave the target before [ticks].
        end: When to be at this one [ticks].
        period: Period of the stream [ticks], 0 if the target is not part of a stream.
        speed: Time between this target and the one before as they were sent, over that as they are played.
        pace: Mean time between the last targets as they came [ticks].
        gap: Time by which the target came later than set points continue without it [ticks].
        apart: Time between this target and the one before by their stamps or arrivals [ticks], 0 if it is unknown.
    """

    start: float
    end: float
    period: float
    speed: float = 1.0
    pace: float = 0.0
    gap: float = 0.0
    apart: float = 0.0

    @property
    def is_immediate(self) -> bool:
        """Whether the target acts at once."""
        return self.start == self.end


class JitterBuffer:
    """Delays the targets of a stream such that they are played at the intervals at which they were meant.

    Two kinds of send times compete. Stamps are those of irregular samples; without valid stamps, arrivals replace them.
    A regular period, fitted to them, is that of samples which a busy machine sends late. Those on which positions lie
    more smoothly are used. Delays are one-sided, so the promptest of the last arrivals counts as undelayed; the buffer
    comes on top. The delay follows changes slowly, except where a target is too late for it.

    Args:
        dt_s: Length of a tick [s].
        buffer_s: Delay in which late targets are still in time [s], one and a half ticks of waiting included; with 0,
            targets are played as they come.
    """

    def __init__(self, dt_s: float, buffer_s: float) -> None:
        self.dt_s, self.has_delay = dt_s, buffer_s > 0.0
        self._buffer = max(buffer_s / dt_s - 1.5, 0.0)
        self._settling = SETTLING_S / dt_s
        self.extrapolation = buffer_s / dt_s / 2.0 + 3.0 if buffer_s else 0.0
        """Time for which a stream continues at its last velocity when the next target is too late [ticks]."""
        self._longest = LONGEST_PERIOD_S / dt_s
        self._sender = SenderClock(dt_s)
        self._seen: deque[Arrival] = deque(maxlen=WINDOW)
        self._start = self._end = 0.0
        self._pace = 0.0
        """Mean time between targets as they came [ticks]; 0 if all of them came before the same tick."""
        self._restart()

    def _restart(self) -> None:
        self._sender.restart()
        self._seen.clear()
        self._count = 0
        self._interval = 0.0
        self._rate = 1.0
        self._is_regular: bool | None = None
        self._misfits = (0.0, 0.0)
        self._out_of_step = 0

    def add(self, tick: int, stamp_ns: int, goal: Mapping[int, float]) -> Playout:
        """Adds a target that comes before a tick.

        Args:
            stamp_ns: Time of sending by the sender's clock [ns], 0 if unknown.
            goal: Positions by joint index [rad or m].
        """
        if self._seen and self._is_apart(tick, stamp_ns):
            self._restart()
        elif self._seen:
            self._pace += (tick - self._seen[-1].tick - self._pace) / WINDOW
        self._seen.append(Arrival(tick, stamp_ns, goal))
        self._count += 1
        times, is_stamped = self._sender.times(self._seen)
        count = len(times)
        intervals = sorted(after - before for before, after in zip(times, times[1:])) or [0.0]
        mean_interval = (times[-1] - times[0]) / len(intervals)
        if mean_interval <= EVERY_TICK or 0.0 < intervals[len(intervals) // 2] <= EVERY_TICK:
            return self._at_every_tick(tick, mean_interval)
        if self._interval and count > 3:
            self._count_lost(times)
        if self._interval and count > PERSISTENT + 1 and self._is_out_of_step(times):
            self._forget()
            times, count = times[-PERSISTENT:], PERSISTENT
        steps = self._steps()
        self._fit(times, steps, is_stamped)
        if count > 3:
            self._compare(times, steps)
        period = self._rate * self._interval
        regular = not is_stamped if self._is_regular is None else self._is_regular
        interval = self._rate * (times[-1] - times[-2])
        if regular or count == 2:
            interval = period * self._seen[-1].step
        undelayed = self._undelayed(times, steps, regular)
        playout = self._schedule(tick, tick + undelayed + self._buffer + period, interval, period)
        return playout._replace(apart=times[-1] - times[-2])

    def _is_apart(self, tick: int, stamp_ns: int) -> bool:
        """Returns whether a target comes, or was sent by a right clock, too long after the last one for a stream."""
        last = self._seen[-1]
        sent_ticks = self._sender.ticks_between(last.stamp_ns, stamp_ns) if self._sender.is_right else 0.0
        return max(tick - last.tick, sent_ticks) > self._longest

    def _at_every_tick(self, tick: int, interval: float) -> Playout:
        """Returns when to play a target that comes alone, or at every tick: at once, or after the rest of a stream."""
        self._interval = 0.0
        if self._end - tick <= EVERY_TICK or not self._pace:
            self._end = float(tick)
            return Playout(self._end, self._end, min(interval, EVERY_TICK))
        self._start = self._end
        self._end += max(SHORTEST * self._pace, SHORTEST_WAY)
        return Playout(self._start, self._end, 2.0 * EVERY_TICK, pace=self._pace)

    def _least_way(self, tick: int) -> float:
        """Returns the least time from the target before to the newest as they are played [ticks].

        While the rest of a stream is still to be played, a burst takes at least half of the time that so many targets
        usually take.
        """
        return max(SHORTEST * self._pace / 2.0, SHORTEST_WAY) if self._end - tick > EVERY_TICK else SHORTEST_WAY

    def _schedule(self, tick: int, planned: float, interval: float, period: float) -> Playout:
        """Returns when to play the newest target, which is as near to the planned time as the delay may change."""
        before = self._end
        if self._count == 2:
            way = max(SHORTEST * interval, self._least_way(tick))
            self._end = max(planned, tick + max(SHORTEST * period, LEAST_AHEAD), before + way)
            self._start = max(self._end - interval, before)
            return Playout(self._start, self._end, period)
        gain = max(min(interval / self._settling, 1.0), 2.0 / (self._count + 2.0))
        regular = before + interval
        end = max(regular + gain * (planned - regular), before + SHORTEST * interval)
        if (late := tick - before) > 0.0:
            beyond = min(late / self.extrapolation - 1.0, 1.0) if self.extrapolation else 1.0
            end = max(end, tick + SHORTEST * period * beyond)
        self._end = end = max(end, tick + LEAST_AHEAD, before + self._least_way(tick))
        if interval <= REPLACED * period:
            return Playout(self._start, end, period, pace=self._pace)
        self._start = before
        gap = max(late - self.extrapolation, 0.0)
        return Playout(before, end, period, interval / (end - before), self._pace, gap)

    def _undelayed(self, times: Sequence[float], steps: Sequence[int], regular: bool) -> float:
        """Returns when the newest target would have come without a delay, from its arrival [ticks].

        Even the promptest is a little late: the bound of uniform delays is estimated without bias.
        """
        tick, scale, sent = self._seen[-1].tick, self._rate, times
        if regular:
            scale, sent = self._rate * self._interval, steps
        delays = [each.tick - tick - scale * time for each, time in zip(self._seen, sent)]
        least = min(delays)
        undelayed = least - 2.0 * (sum(delays) / len(delays) - least) / len(delays)
        self._out_of_step = self._out_of_step + 1 if undelayed < -self._buffer - 1.0 else 0
        return undelayed

    def _steps(self) -> list[int]:
        """Returns the number of periods from the newest target to each."""
        steps = [0]
        for each in list(self._seen)[:0:-1]:
            steps.append(steps[-1] - each.step)
        return steps[::-1]

    def _fit(self, times: Sequence[float], steps: Sequence[int], is_stamped: bool) -> None:
        """Estimates the period, and how fast the world runs by stamps."""
        is_full = len(times) == WINDOW
        share = 1.0 / WINDOW if is_full and self._interval else 1.0
        self._interval += share * (_slope(steps, times) - self._interval)
        if not is_stamped:
            self._rate = 1.0
        elif is_full:
            tick = self._seen[-1].tick
            rate = _slope(times, [float(each.tick - tick) for each in self._seen])
            self._rate += share * (min(max(rate, 1.0 - DRIFT), 1.0 + DRIFT) - self._rate)

    def _is_out_of_step(self, times: Sequence[float]) -> bool:
        """Returns whether the period has changed, or targets have become later for good."""
        if self._out_of_step >= PERSISTENT:
            return True
        lowest, highest = SAME_PERIOD
        steps = [each.step for each in list(self._seen)[-PERSISTENT:]]
        mean_interval = (times[-1] - times[-1 - PERSISTENT]) / sum(steps)
        return min(steps) > 1 or not lowest < mean_interval / self._interval < highest

    def _forget(self) -> None:
        """Forgets all but the newest targets."""
        newest = list(self._seen)[-PERSISTENT:]
        self._seen.clear()
        self._seen.extend(each._replace(step=1) for each in newest)
        self._count = PERSISTENT
        self._out_of_step = 0

    def _count_lost(self, times: Sequence[float]) -> None:
        """Counts targets lost before the newest one, judged by its positions; otherwise it is late."""
        periods = round((times[-1] - times[-2]) / self._interval)
        if not 1 < periods <= MAX_LOST:
            return
        last = list(self._seen)[-4:]
        before = (-last[1].step - last[2].step, -last[2].step, 0)
        if MIN_LOSS_RATIO * _misfit((*before, periods), last) < _misfit((*before, 1), last):
            self._seen[-1] = last[-1]._replace(step=periods)

    def _compare(self, times: Sequence[float], steps: Sequence[int]) -> None:
        """Chooses between stamps (or arrivals) and a regular period."""
        last = list(self._seen)[-4:]
        new = _misfit(times[-4:], last), _misfit(steps[-4:], last)
        if not all(map(math.isfinite, new)):
            return
        change = new[0] - new[1]
        irregular, regular = ((1.0 - 1.0 / WINDOW) * sum_ for sum_ in self._misfits)
        self._misfits = irregular, regular = irregular + max(change, 0.0), regular + max(-change, 0.0)
        if irregular > MIN_MISFIT_RATIO * regular + MIN_MISFIT:
            self._is_regular = True
        elif regular > MIN_MISFIT_RATIO * irregular + MIN_MISFIT:
            self._is_regular = False


def _slope(x: Sequence[float], y: Sequence[float]) -> float:
    """Returns the slope of the line that lies under all points and nearest to them on average.

    That is the best estimate if delays are one-sided (Moon, Skelly, Towsley: Estimation and removal of clock skew from
    network delay measurements, INFOCOM 1999). The line runs along the lower convex hull, below the mean of x.
    """
    hull: list[tuple[float, float]] = []
    for point in zip(x, y):
        while len(hull) > 1 and _rise(hull[-2], hull[-1]) >= _rise(hull[-2], point):
            hull.pop()
        hull.append(point)
    mean = sum(x) / len(x)
    return next((_rise(*edge) for edge in zip(hull, hull[1:]) if edge[1][0] >= mean), 0.0)


def _rise(first: tuple[float, float], last: tuple[float, float]) -> float:
    """Returns the slope between two points."""
    return (last[1] - first[1]) / (last[0] - first[0])


def _misfit(times: Sequence[float], arrivals: Sequence[Arrival]) -> float:
    """Returns how far the last of four targets is from the parabola through those before, squared; inf without one."""
    a, b, c, d = times
    if not a < b < c:
        return math.inf
    weights = (
        (d - b) * (d - c) / ((a - b) * (a - c)),
        (d - a) * (d - c) / ((b - a) * (b - c)),
        (d - a) * (d - b) / ((c - a) * (c - b)),
    )
    *before, last = (each.goal for each in arrivals)
    return sum((value - sum(w * goal[i] for w, goal in zip(weights, before))) ** 2 for i, value in last.items())
