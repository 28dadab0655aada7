"""Jitter buffer: schedules when each target of a stream is played, that is, when the set points reach the target."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from .sender_clock import DRIFT, Arrival, SenderClock

BUFFER_S = 0.02
"""Default buffer delay [s]. A target that arrives late by less than the delay is still played on time."""
LONGEST_PERIOD_S = 0.2
"""Longest interval [s] between the targets of a stream. Targets with longer intervals act at once."""
EVERY_TICK = 1.5
"""Largest interval [ticks] of targets that come at every tick. These targets act at once, too."""
WINDOW = 64
"""Number of arrivals from which period, rate and delay are estimated."""
SETTLING_S = 0.8
"""Time constant [s] with which the delay changes; shorter for the first targets of a stream."""
SHORTEST = 0.8
"""Smallest ratio of the interval with which two targets are played to the interval with which they were sent."""
REPLACED = 0.25
"""A target replaces the previous target if it was sent within this share of the period after the previous one."""
MIN_MISFIT_RATIO = 2.0
"""Ratio of accumulated squared misfits above which a regular period replaces the stamps, or the reverse."""
MIN_MISFIT = 1e-10
"""Difference of squared misfits [rad^2 or m^2] below which both kinds of send times count as equal."""
MIN_LOSS_RATIO = 16.0
"""Ratio of squared misfits above which a gap is explained by lost targets rather than by a late target."""
MAX_LOST = 4
"""Longest gap that can be explained by lost targets [periods]."""
PERSISTENT = 16
"""Number of consecutive targets that deviate from the estimates after which older targets are forgotten."""
SAME_PERIOD = (0.6, 1.6)
"""Range of the mean of the last `PERSISTENT` intervals for which the period counts as unchanged [periods]."""
SHORTEST_WAY = 0.05
"""Smallest interval [ticks] with which two targets are played."""
LEAST_AHEAD = 0.25
"""Smallest delay [ticks] between arrival and playing of a target."""


class Playout(NamedTuple):
    """Schedule of one target; times are in ticks of the world.

    Attributes:
        start: Time [ticks] at which set points leave the previous target.
        end: Time [ticks] at which set points reach this target.
        period: Period of the stream [ticks]; 0 if the target does not belong to a stream.
        speed: Time between sending the previous target and sending this target, divided by the time between playing
            the two targets.
        pace: Mean interval [ticks] between the arrivals of recent targets.
        gap: Time [ticks] from the end of the extrapolation beyond the previous target to this target's arrival; 0 if
            this target came before that end.
        apart: Interval [ticks] from the previous target to this one, by stamps or arrivals; 0 if unknown.
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
    """Delays the targets of a stream such that set points reach them at the intervals at which they were sampled.

    Send times are estimated in two ways. The first estimate, for samples at irregular intervals, equals the stamps, or
    the arrivals if stamps are not valid. The second estimate, for regular samples that a busy machine sends late,
    consists of equally spaced times that are fitted to the first estimate. The buffer uses the estimate for which
    positions change more smoothly over time.

    Transport delays are never negative, so the recent target with the smallest delay counts as undelayed. A target is
    played at the time at which it would have come undelayed, plus the buffer delay and one period of the stream. The
    offset from send times to play times changes slowly, except if a target comes too late for the present offset.

    Args:
        dt_s: Length of a tick [s].
        buffer_s: Buffer delay [s], of which one and a half ticks cover each target's wait for the next tick. A target
            that arrives late by less than the buffer delay is still played on time. 0 plays targets as they come.
    """

    def __init__(self, dt_s: float, buffer_s: float) -> None:
        self.dt_s, self.has_delay = dt_s, buffer_s > 0.0
        self._buffer = max(buffer_s / dt_s - 1.5, 0.0)
        self._settling = SETTLING_S / dt_s
        self.extrapolation = buffer_s / dt_s / 2.0 + 3.0 if buffer_s else 0.0
        """Time [ticks] for which set points continue at their last velocity if the next target is late."""
        self._longest = LONGEST_PERIOD_S / dt_s
        self._sender = SenderClock(dt_s)
        self._seen: deque[Arrival] = deque(maxlen=WINDOW)
        self._start = self._end = 0.0
        self._pace = 0.0
        """Mean interval [ticks] between arrivals; 0 if all targets came before the same tick."""
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
        """Adds a target, and returns its schedule.

        Args:
            tick: Number of the first tick after the target came.
            stamp_ns: Time [ns] of sending by the sender's clock; 0 if unknown.
            goal: Target positions [rad or m], keyed by joint index.
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
        """Returns True if the arrivals or the valid stamps of the last two targets are too far apart for one stream."""
        last = self._seen[-1]
        sent_ticks = self._sender.ticks_between(last.stamp_ns, stamp_ns) if self._sender.is_right else 0.0
        return max(tick - last.tick, sent_ticks) > self._longest

    def _at_every_tick(self, tick: int, interval: float) -> Playout:
        """Schedules a single target, or a target of a stream that has a target at every tick.

        The target acts at once, or after the targets that are still to be played.
        """
        self._interval = 0.0
        if self._end - tick <= EVERY_TICK or not self._pace:
            self._end = float(tick)
            return Playout(self._end, self._end, min(interval, EVERY_TICK))
        self._start = self._end
        self._end += max(SHORTEST * self._pace, SHORTEST_WAY)
        return Playout(self._start, self._end, 2.0 * EVERY_TICK, pace=self._pace)

    def _least_way(self, tick: int) -> float:
        """Returns the minimum interval [ticks] between playing the previous target and playing the newest one.

        While earlier targets are still to be played, this minimum is at least 0.4 times the mean interval between
        arrivals. This limits the speed at which a burst of targets is played.
        """
        return max(SHORTEST * self._pace / 2.0, SHORTEST_WAY) if self._end - tick > EVERY_TICK else SHORTEST_WAY

    def _schedule(self, tick: int, planned: float, interval: float, period: float) -> Playout:
        """Schedules the newest target as near to `planned` as possible, since the delay may only change slowly.

        Args:
            tick: Number of the first tick after the target came.
            planned: Time [ticks] at which the target should be played according to the present estimates.
            interval: Estimated interval [ticks] since the previous target was sent.
            period: Estimated period of the stream [ticks].
        """
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
        """Returns the estimated undelayed arrival time [ticks] of the newest target, relative to the actual arrival.

        The smallest delay of the recent targets is slightly above zero. The estimate corrects this under the assumption
        that delays are distributed uniformly.
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
        """Returns each recent target's send time relative to the newest target, in whole periods: 0 or negative."""
        steps = [0]
        for each in list(self._seen)[:0:-1]:
            steps.append(steps[-1] - each.step)
        return steps[::-1]

    def _fit(self, times: Sequence[float], steps: Sequence[int], is_stamped: bool) -> None:
        """Updates the estimates of the period, and of the world's rate relative to the sender's clock."""
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
        """Returns True if the stream's period has changed, or if the transport delay has grown permanently."""
        if self._out_of_step >= PERSISTENT:
            return True
        lowest, highest = SAME_PERIOD
        steps = [each.step for each in list(self._seen)[-PERSISTENT:]]
        mean_interval = (times[-1] - times[-1 - PERSISTENT]) / sum(steps)
        return min(steps) > 1 or not lowest < mean_interval / self._interval < highest

    def _forget(self) -> None:
        """Forgets all targets except the newest `PERSISTENT`."""
        newest = list(self._seen)[-PERSISTENT:]
        self._seen.clear()
        self._seen.extend(each._replace(step=1) for each in newest)
        self._count = PERSISTENT
        self._out_of_step = 0

    def _count_lost(self, times: Sequence[float]) -> None:
        """Counts the targets that were lost before the newest target.

        After a gap, the positions show which case applies: targets were lost, or the newest target is late.
        """
        periods = round((times[-1] - times[-2]) / self._interval)
        if not 1 < periods <= MAX_LOST:
            return
        last = list(self._seen)[-4:]
        before = (-last[1].step - last[2].step, -last[2].step, 0)
        if MIN_LOSS_RATIO * _misfit((*before, periods), last) < _misfit((*before, 1), last):
            self._seen[-1] = last[-1]._replace(step=periods)

    def _compare(self, times: Sequence[float], steps: Sequence[int]) -> None:
        """Chooses one of two estimates of the send times: the stamps (or arrivals), or equally spaced times.

        Chooses the estimate over which positions change more smoothly.
        """
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
    """Returns the slope of the line that is below all points and has the smallest mean distance to the points.

    This line is the best estimate if delays are never negative (Moon, Skelly, Towsley: Estimation and removal of clock
    skew from network delay measurements, INFOCOM 1999). The line contains the edge of the lower convex hull at the mean
    of x.
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
    """Returns how far the last of four targets is from the parabola over time through the first three targets.

    The result is a squared distance; infinity if the times of the first three targets do not increase.
    """
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
