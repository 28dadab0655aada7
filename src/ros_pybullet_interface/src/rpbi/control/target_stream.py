"""Streams of position targets as smooth motions.

Targets come some times a second, ticks many times. A motor that gets each target as a step closes it within a few
ticks, with all the effort it has. So a target that follows another one soon is a knot: the set points go there on a
line that takes as long as the targets are apart, and a moving average over the same time rounds the corners. For a
regular stream that is a quadratic B-spline; it lags by one and a half periods and never leaves the hull of its targets.
Targets that tell velocities too are joined by cubics, which lag by one period.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping
from typing import NamedTuple

from .motors import POSITION_MODES, Command, Motors, joined

LONGEST_PERIOD_S = 0.2
"""Targets that are farther apart than this [s] are no stream: each acts at once."""
REMEMBERED = 32
"""Arrivals that tell how far apart targets are, and how late they come."""
ALWAYS = 1.5
"""Targets that are no farther apart than this many ticks need no interpolation."""
SHORTEST = 0.8
"""A segment takes this share of the period at least, when it has to catch up."""
DRIFT = 0.1
"""Stamps count as long as they run as fast as the world's time within this share."""


class Segment(NamedTuple):
    """The way of some joints from one target to the next.

    Attributes:
        start: When it begins [ticks].
        length: How long it takes [ticks].
        window: Length of the moving average [ticks]; 0 is none.
        goal: The target by joint index [rad or m].
        way: How far it is from the target before.
        slopes: Velocities at both ends by joint index [rad or m per tick], None if it is a line.
    """

    start: float
    length: float
    window: float
    goal: Mapping[int, float]
    way: Mapping[int, float]
    slopes: tuple[Mapping[int, float], Mapping[int, float]] | None

    def is_over(self, tick: float) -> bool:
        """Returns whether the goal is reached at a time."""
        return tick >= self.start + self.length + self.window

    def share(self, tick: float) -> float:
        """Returns how much of a line is done at a time, averaged over the window: from 0 to 1, never falling."""
        late = tick - self.start
        if not self.window:
            return min(max(late / self.length, 0.0), 1.0)
        return (self._covered(late) - self._covered(late - self.window)) / self.window

    def _covered(self, late: float) -> float:
        """Returns the integral of the share without the average."""
        if late <= 0.0:
            return 0.0
        return late * late / (2.0 * self.length) if late < self.length else late - self.length / 2.0

    def done(self, index: int, share: float) -> float:
        """Returns how far a joint has come [rad or m]; of a cubic (Hermite), the share is that of the time."""
        if self.slopes is None:
            return self.way[index] * share
        first, last = self.slopes[0][index] * self.length, self.slopes[1][index] * self.length
        rest = 1.0 - share
        return share * share * (3.0 - 2.0 * share) * self.way[index] + share * rest * (first * rest - last * share)


class Arrivals:
    """Tells when to play each target of a stream, from when it came and, where senders stamp, when it was sent.

    Targets are delayed so that the intervals of their stamps are kept: by as much as the latest of late came too late,
    but by no more than a buffer. Stamps that are 0 or of another clock do not count; then targets are played as they
    come.

    Args:
        dt_s: Length of a tick [s].
        buffer_s: Longest delay of a target that came in time [s].
    """

    def __init__(self, dt_s: float, buffer_s: float) -> None:
        self._dt_ns = dt_s * 1e9
        self._buffer = buffer_s / dt_s
        self._longest = LONGEST_PERIOD_S / dt_s
        self._seen: deque[tuple[int, int]] = deque(maxlen=REMEMBERED)
        self._end = 0.0

    def add(self, tick: int, stamp_ns: int) -> tuple[float, float, float]:
        """Takes a target that comes before a tick.

        Returns:
            Start and length of the way to it and the period of the stream [ticks]. The period is 0 if it is not part of
            a stream; it has no way to go then, nor if the period is at most ALWAYS.
        """
        seen = self._seen
        if seen and tick - seen[-1][0] > self._longest:
            seen.clear()
        seen.append((tick, stamp_ns))
        sent = self._sent()
        period = (sent[-1] - sent[0]) / max(len(sent) - 1, 1)
        if period <= ALWAYS:
            self._end = float(tick)
            return self._end, 0.0, period
        late = [arrival - time for (arrival, _), time in zip(seen, sent)]
        start = max(float(tick), self._end)
        planned = sent[-1] + min(max(late), min(late) + self._buffer) + period
        self._end = max(planned, start + SHORTEST * period)
        return start, self._end - start, period

    def _sent(self) -> list[float]:
        """Returns when the targets were sent, in ticks counted from the newest, by their stamps if these make sense."""
        tick, stamp_ns = self._seen[-1]
        by_arrival = [float(each - tick) for each, _ in self._seen]
        by_stamp = [(each - stamp_ns) / self._dt_ns for _, each in self._seen]
        rises = all(before < after for before, after in zip(by_stamp, by_stamp[1:]))
        allowed = self._longest / 2.0 - DRIFT * by_arrival[0]
        return by_stamp if rises and abs(by_stamp[0] - by_arrival[0]) <= allowed else by_arrival


class TargetStream:
    """The targets of some joints that always come together.

    Args:
        held: Where the joints are held now by index [rad or m].
        smooth: Whether lines are averaged.
    """

    def __init__(self, arrivals: Arrivals, held: Mapping[int, float], smooth: bool) -> None:
        self.joints = frozenset(held)
        self._arrivals, self._smooth = arrivals, smooth
        self._segments: deque[Segment] = deque()
        self._base = self._goal = held
        self._slopes: Mapping[int, float] = {}
        self.set_points = held
        """Where the joints are to be now."""
        self.rests = True
        """Whether there is nothing to do until the next target."""

    def take(self, tick: int, goal: Mapping[int, float], slopes: Mapping[int, float], stamp_ns: int) -> None:
        """Takes a target that comes before a tick.

        Args:
            goal: Positions by joint index [rad or m].
            slopes: Velocities by joint index [rad or m per tick], empty if they are not given.
            stamp_ns: When it was sent, by the sender's clock [ns], 0 if that is not known.
        """
        start, length, period = self._arrivals.add(tick, stamp_ns)
        if period <= ALWAYS:
            self._segments.clear()
            self._base = goal
            has_lead = period > 0.0 and slopes
            self.set_points = {index: value - slopes[index] for index, value in goal.items()} if has_lead else goal
        else:
            way = {index: value - self._goal[index] for index, value in goal.items()}
            ends = (self._slopes, slopes)
            is_cubic = all(ends) and _agree(way, length, *ends)
            window = period if self._smooth and not is_cubic else 0.0
            self._segments.append(Segment(start, length, window, goal, way, ends if is_cubic else None))
        self._goal, self._slopes, self.rests = goal, slopes, False

    def advance(self, tick: float) -> Mapping[int, float]:
        """Goes on to a time, and returns where the joints are to be then by index [rad or m]."""
        while self._segments and self._segments[0].is_over(tick):
            self._base = self._segments.popleft().goal
        self.rests = not self._segments and self.set_points == self._base
        positions = dict(self._base)
        share = 1.0
        for segment in self._segments:
            share = min(share, segment.share(tick))  # so that no target counts more than one before it
            for index in positions:
                positions[index] += segment.done(index, share)
        self.set_points = positions
        return positions


def _agree(way: Mapping[int, float], length: float, first: Mapping[int, float], last: Mapping[int, float]) -> bool:
    """Returns whether velocities fit the way; many senders fill them with zeros."""
    return all(
        abs(distance - length * (first[index] + last[index]) / 2.0)
        <= length * max(abs(first[index]), abs(last[index])) / 2.0 + 1e-9
        for index, distance in way.items()
    )


class TargetStreams:
    """Follows the position targets of one robot; joints whose targets come together are a stream.

    Args:
        dt_s: Length of a tick [s].
        smooth: Whether corners are rounded.
        buffer_s: Longest delay of targets to even out how late they come [s].
    """

    def __init__(self, motors: Motors, dt_s: float, smooth: bool, buffer_s: float) -> None:
        self._motors, self._dt_s, self._smooth, self._buffer_s = motors, dt_s, smooth, buffer_s
        self._waiting: tuple[Command, ...] = ()
        self._streams: dict[frozenset[int], TargetStream] = {}

    def follow(self, commands: Iterable[Command]) -> None:
        """Follows targets from the coming tick on."""
        for command in commands:
            self._waiting = joined(self._waiting, (command,))

    def drop(self, joints: Iterable[int]) -> None:
        """Forgets the streams of joints that something else drives from now on; what else moves by them holds."""
        dropped = set(joints)
        for key in [key for key in self._streams if key & dropped]:
            self._motors.release(self._streams.pop(key).joints - dropped)

    def clear(self) -> None:
        """Forgets all targets; the joints hold."""
        self._waiting = ()
        self.drop(frozenset().union(*self._streams))

    def advance(self, tick: int, driven: frozenset[int]) -> None:
        """Sets the motors for a tick.

        Args:
            driven: Joints that a motion drives; targets for them are dropped.
        """
        if self._waiting:
            for command in self._waiting:
                self._take(tick, command, driven)
            self._waiting = ()
        for stream in self._streams.values():
            if not stream.rests:
                self._drive(tick, stream)

    def _take(self, tick: int, command: Command, driven: frozenset[int]) -> None:
        if command.mode not in POSITION_MODES or self._motors.mode != command.mode:
            return
        goal = {
            index: self._motors.limited(index, value) for index, value in command.values.items() if index not in driven
        }
        joints = frozenset(goal)
        if not joints:
            return
        if joints not in self._streams:
            self.drop(joints)
            held = {index: self._motors.targets[index] for index in joints}
            self._streams[joints] = TargetStream(Arrivals(self._dt_s, self._buffer_s), held, self._smooth)
        slopes = {index: command.velocities[index] * self._dt_s for index in joints} if command.velocities else {}
        self._streams[joints].take(tick, goal, slopes, command.stamp_ns)

    def _drive(self, tick: int, stream: TargetStream) -> None:
        before = stream.set_points
        after = stream.advance(tick + 1.0)
        if stream.rests:
            self._motors.hold(after)
            return
        for index, position in after.items():
            self._motors.track(index, before[index], (position - before[index]) / self._dt_s)
