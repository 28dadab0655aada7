"""Streams of position targets as smooth motions.

Targets come at a lower rate than ticks. A motor would follow each step within a few ticks, with its full effort.
Targets in quick succession are therefore knots: set points move along lines, each as long as the time between two
targets, and a moving average over one period rounds the corners. For a regular stream that is a quadratic B-spline,
which lags by one and a half periods. Targets with velocities are joined by cubics, which lag by one period. The delay
of the jitter buffer comes on top.

A target that is too late even for the buffer must not stop the robot from full speed. The set points continue at the
last velocity for a while, then slow down and come back to the last target. Where that plan changes its velocity at
once, as when late targets come, the set points follow it with the accelerations of a `BoundedMotion`.
"""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable, Iterable, Mapping

from .jitter_buffer import EVERY_TICK, JitterBuffer
from .motors import POSITION_MODES, Motors, ResolvedCommand, coalesce
from .stream_motion import BoundedMotion, StreamSegment, agree

log = logging.getLogger(__name__)

ADAPTATION_PERIODS = 4.0
"""Time constant with which the window of the moving average follows the period [periods]."""
SHORT_SEGMENT = 0.5
"""Length of a segment, as a share of the time between targets, below which its velocity is not extrapolated."""
SAME_TIME = 1e-9
"""Difference of times that is an error of rounding [ticks]."""
QUIET_S = 60.0
"""Time after a warning of late targets without another [s] of the world's time."""


class TargetStream:
    """The targets of some joints that always come together.

    Args:
        held: Where the joints are held now by index [rad or m].
        smooth: Whether lines are averaged.
        limited: Returns a position of a joint by index within its limits; None without limits.
    """

    def __init__(
        self,
        buffer: JitterBuffer,
        held: Mapping[int, float],
        smooth: bool,
        limited: Callable[[int, float], float] | None = None,
    ) -> None:
        self.joints = frozenset(held)
        self.buffer, self._smooth, self._limits = buffer, smooth, limited
        self._segments: deque[StreamSegment] = deque()
        self._base = self._goal = held
        self._slopes: Mapping[int, float] = {}
        self._velocities: deque[Mapping[int, float]] = deque(maxlen=3)
        """Velocities at the last targets by joint index [rad or m per tick]; none after a shortened segment."""
        self._period = 0.0
        self._window = self._lagging_window = self._wanted_window = 0.0
        self._motion = BoundedMotion(held, buffer.dt_s, buffer.has_delay, self._limited)
        self.set_points = held
        """Present set points by joint index [rad or m]."""
        self.gap = 0.0
        """Time for which the motion had stopped before the newest target, which came too late [ticks]."""
        self.rests = True
        """Whether there is nothing to do until the next target."""

    def push(self, tick: int, goal: Mapping[int, float], slopes: Mapping[int, float], stamp_ns: int) -> None:
        """Adds a target that comes before a tick.

        Args:
            goal: Positions by joint index [rad or m].
            slopes: Velocities by joint index [rad or m per tick]; may be empty.
            stamp_ns: Time of sending by the sender's clock [ns], 0 if unknown.
        """
        playout = self.buffer.add(tick, stamp_ns, goal)
        self.gap = playout.gap
        is_under_way = self._motion.is_under_way(tick)
        if playout.is_immediate:
            self._segments.clear()
            self._velocities.clear()
            self._base = goal
            has_lead = playout.period > 0.0 and slopes
            planned = {index: value - slopes[index] for index, value in goal.items()} if has_lead else goal
            if is_under_way:
                self._motion.jump(planned)
            else:
                self._motion.restart(planned, slopes if has_lead else {})
                self.set_points = planned
            self._period = 0.0
        else:
            slopes = {index: velocity * playout.speed for index, velocity in slopes.items()}
            segment = self._append(max(playout.start, float(tick)), playout.end, goal, slopes)
            period = max(playout.period, EVERY_TICK)
            if segment.length < SHORT_SEGMENT * max(period, playout.pace):
                self._velocities.clear()
            else:
                self._velocities.append(segment.velocity(playout.end))
            self._wanted_window = period if self._smooth and segment.slopes is None else 0.0
            if not self._period:
                self._window = self._lagging_window = self._wanted_window
            self._period = period
        if is_under_way or not playout.is_immediate:
            ways = {index: value - self._goal[index] for index, value in goal.items()}
            corner = 0.0 if self._smooth or slopes else 1.0
            self._motion.add(ways, playout.apart, corner)
        self._goal, self._slopes, self.rests = goal, slopes, False

    def _append(
        self, start: float, end: float, goal: Mapping[int, float], slopes: Mapping[int, float]
    ) -> StreamSegment:
        """Appends the segment to a target, and drops all segments beyond its start."""
        segments = self._segments
        leaving, before = self._goal, self._slopes or None
        while segments and segments[-1].end > start + SAME_TIME:
            segment = segments.pop()
            before = before and segment.slopes and segment.velocity(start)
            done = segment.cut(start)
            leaving = done.goal
            if done.length > 0.0:
                segments.append(done)
        way = {index: value - leaving[index] for index, value in goal.items()}
        ends = (before, slopes) if before and slopes and agree(way, end - start, before, slopes) else None
        segments.append(StreamSegment(start, end - start, goal, way, ends))
        return segments[-1]

    def advance(self, tick: float) -> Mapping[int, float]:
        """Advances to a time, and returns the positions then by joint index [rad or m]."""
        segments = self._segments
        if segments and segments[-1].end <= tick and not segments[-1].is_beyond:
            self._go_beyond()
        if self._window != self._wanted_window:
            self._adapt_window()
        while segments and segments[0].end + self._window <= tick:
            self._base = segments.popleft().goal
        self.rests = not segments and self.set_points == self._base
        positions = dict(self._base)
        for segment in segments:
            basis = segment.basis(tick, self._window)
            for index in positions:
                positions[index] += segment.covered(index, basis)
        if any(segment.slopes is not None for segment in segments):  # cubics may leave the hull of their targets
            positions = {index: self._limited(index, value) for index, value in positions.items()}
        self.set_points = self._motion.advance(positions)
        return self.set_points

    def _limited(self, index: int, value: float) -> float:
        return value if self._limits is None else self._limits(index, value)

    def _adapt_window(self) -> None:
        """Changes the window slowly, since its changes move the set points: a low-pass of second order."""
        share = 1.0 / max(ADAPTATION_PERIODS * self._period, 1.0)
        self._lagging_window += share * (self._wanted_window - self._lagging_window)
        self._window += share * (self._lagging_window - self._window)
        if abs(self._wanted_window - self._window) + abs(self._wanted_window - self._lagging_window) < 1e-6:
            self._window = self._lagging_window = self._wanted_window

    def _go_beyond(self) -> None:
        """Extrapolates from the last target at its velocity, slows down and returns to it."""
        last, length = self._segments[-1], self.buffer.extrapolation
        if last.slopes is None:
            first = then = {index: self._next_velocity(index) for index in last.way}
        else:
            first, bends = dict(last.slopes[1]), last.acceleration_at_end()
            means = {index: (value - last.slopes[0][index]) / last.length for index, value in first.items()}
            then = {index: value + length * _lesser(bends[index], means[index]) for index, value in first.items()}
        if length <= 0.0 or not any((*first.values(), *then.values())):
            return
        rest, brake = dict.fromkeys(first, 0.0), self._motion.brake
        on = {index: length * (value + then[index]) / 2.0 for index, value in first.items()}
        self._extend(length, on, first, then)
        self._extend(brake, {index: brake * value / 2.0 for index, value in then.items()}, then, rest)
        back = {index: value - self._segments[-1].goal[index] for index, value in last.goal.items()}
        self._extend(2.0 * brake, back, rest, rest)

    def _extend(
        self, length: float, way: Mapping[int, float], first: Mapping[int, float], last: Mapping[int, float]
    ) -> None:
        """Appends a cubic beyond the last target; joints stop at their limits."""
        before = self._segments[-1]
        goal = {index: self._limited(index, value + way[index]) for index, value in before.goal.items()}
        stopped = {index for index, value in before.goal.items() if goal[index] != value + way[index]}
        slopes = tuple({i: 0.0 if i in stopped else value for i, value in each.items()} for each in (first, last))
        within = {index: value - before.goal[index] for index, value in goal.items()}
        self._segments.append(StreamSegment(before.end, length, goal, within, (slopes[0], slopes[1]), True))

    def _next_velocity(self, index: int) -> float:
        """Returns the velocity of a line to the next target as far as the last three ways agree on it, else 0."""
        if len(self._velocities) < 3:
            return 0.0
        first, second, third = (each[index] for each in self._velocities)
        change = _lesser(third - second, second - first)
        return third + change if abs(third - second) <= 2.0 * abs(change) else _lesser(second, third)


def _lesser(a: float, b: float) -> float:
    """Returns the smaller one of two numbers of the same sign, else 0."""
    return 0.0 if a * b <= 0.0 else min(a, b, key=abs)


class TargetStreams:
    """Follows the position targets of one robot; joints whose targets come together are a stream.

    Args:
        name: The robot, for messages.
        dt_s: Length of a tick [s].
        smooth: Whether corners are rounded.
        buffer_s: Delay in which late targets are still in time [s].
    """

    def __init__(self, motors: Motors, name: str, dt_s: float, smooth: bool, buffer_s: float) -> None:
        self._motors, self._name, self._dt_s = motors, name, dt_s
        self._smooth, self._buffer_s = smooth, buffer_s
        self._quiet_until = 0
        """Tick from which late targets are reported again."""
        self._waiting: tuple[ResolvedCommand, ...] = ()
        self._streams: dict[frozenset[int], TargetStream] = {}

    def _report_gap(self, tick: int, stream: TargetStream) -> None:
        if tick < self._quiet_until:
            return
        self._quiet_until = tick + round(QUIET_S / self._dt_s)
        log.warning(
            "%s: a target came %.0f ms too late, so that the motion slowed down; target_buffer_s is %.0f ms;"
            " end other programs, or raise it",
            self._name,
            1e3 * stream.gap * self._dt_s,
            1e3 * self._buffer_s,
        )

    @property
    def rest(self) -> bool:
        """Whether there is nothing to do until the next target."""
        return not self._waiting and all(stream.rests for stream in self._streams.values())

    def follow(self, commands: Iterable[ResolvedCommand]) -> None:
        """Follows targets from the coming tick on."""
        for command in commands:
            self._waiting = coalesce(self._waiting, (command,))

    def drop(self, joints: Iterable[int]) -> None:
        """Drops the streams of joints that get another driver; other joints of these streams hold."""
        dropped = set(joints)
        for key in [key for key in self._streams if key & dropped]:
            self._motors.release(self._streams.pop(key).joints - dropped)

    def clear(self) -> None:
        """Drops all targets; the joints hold."""
        self._waiting = ()
        self.drop(frozenset().union(*self._streams))

    def advance(self, tick: int, driven: frozenset[int]) -> None:
        """Sets the motors for a tick.

        Args:
            driven: Joints that a motion drives; targets for them are dropped.
        """
        if self._waiting:
            for command in self._waiting:
                self._begin(tick, command, driven)
            self._waiting = ()
        for stream in self._streams.values():
            if not stream.rests:
                self._drive(tick, stream)

    def _begin(self, tick: int, command: ResolvedCommand, driven: frozenset[int]) -> None:
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
            self._streams[joints] = TargetStream(
                JitterBuffer(self._dt_s, self._buffer_s), held, self._smooth, self._motors.nearest_allowed
            )
        slopes = {index: command.velocities[index] * self._dt_s for index in joints} if command.velocities else {}
        stream = self._streams[joints]
        stream.push(tick, goal, slopes, command.stamp_ns)
        if stream.gap:
            self._report_gap(tick, stream)

    def _drive(self, tick: int, stream: TargetStream) -> None:
        before = stream.set_points
        after = stream.advance(tick + 1.0)
        if stream.rests:
            self._motors.hold(after)
            return
        for index, position in after.items():
            self._motors.track(index, before[index], (position - before[index]) / self._dt_s)
