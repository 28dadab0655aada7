"""Turns streams of position targets into smooth motions.

Targets come at a lower rate than ticks. Without interpolation, a motor would follow each step of the targets within a
few ticks, with full effort. Set points therefore move along a line from target to target, in the time between the two
targets. A moving average over one period rounds the corners. For a regular stream, the result is a quadratic B-spline,
which lags by one and a half periods. Targets with velocities are joined by cubics, which lag by one period. The jitter
buffer adds its delay.

If a target is too late even for the buffer, the robot must not stop abruptly. The set points continue at their last
velocity for a while, then slow down and return to the last target. When the late target comes, the velocity of this
plan jumps. A `BoundedMotion` then limits the accelerations of the set points.
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
"""Time constant with which the length of the moving average follows the period [periods]."""
SHORT_SEGMENT = 0.5
"""Duration of a segment, as a share of the period, below which the segment's velocity is not extrapolated."""
SAME_TIME = 1e-9
"""Difference of times that counts as a rounding error [ticks]."""
QUIET_S = 60.0
"""Shortest interval [s], in the world's time, between two warnings about late targets."""


class TargetStream:
    """Computes set points for a group of joints whose targets always come together.

    Args:
        buffer: Jitter buffer of the stream.
        held: Initial set points [rad or m], keyed by joint index.
        smooth: Whether a moving average rounds the corners between lines.
        limited: Function from a joint index and a position to the position clipped to the joint's limits. None does not
            clip.
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
        """Velocities [rad or m per tick] at up to three recent targets, keyed by joint index.

        Emptied after a shortened segment.
        """
        self._period = 0.0
        self._window = self._lagging_window = self._wanted_window = 0.0
        self._motion = BoundedMotion(held, buffer.dt_s, buffer.has_delay, self._limited)
        self.set_points = held
        """Present set points [rad or m], keyed by joint index."""
        self.gap = 0.0
        """Time [ticks] between the end of extrapolation and the newest target; 0 if the target came earlier."""
        self.rests = True
        """Whether set points do not move until the next target."""

    def push(self, tick: int, goal: Mapping[int, float], slopes: Mapping[int, float], stamp_ns: int) -> None:
        """Adds a target.

        Args:
            tick: Number of the first tick after the target came.
            goal: Target positions [rad or m], keyed by joint index.
            slopes: Velocities [rad or m per tick] at the target positions, keyed by joint index; may be empty.
            stamp_ns: Time [ns] of sending by the sender's clock; 0 if unknown.
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
        """Appends and returns the segment to a target; cuts earlier segments off at the new segment's start."""
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
        """Advances the stream to a time [ticks], and returns the set points [rad or m], keyed by joint index.

        Set points are clipped to the joints' limits if the targets have velocities, or if the set points have bounded
        accelerations. Otherwise set points lie between targets, so clipping is not needed.
        """
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
        if any(segment.slopes is not None for segment in segments):  # a cubic may overshoot its targets
            positions = {index: self._limited(index, value) for index, value in positions.items()}
        self.set_points = self._motion.advance(positions)
        return self.set_points

    def _limited(self, index: int, value: float) -> float:
        return value if self._limits is None else self._limits(index, value)

    def _adapt_window(self) -> None:
        """Changes the moving average's length gradually (second-order low-pass), since each change moves set points."""
        share = 1.0 / max(ADAPTATION_PERIODS * self._period, 1.0)
        self._lagging_window += share * (self._wanted_window - self._lagging_window)
        self._window += share * (self._lagging_window - self._window)
        if abs(self._wanted_window - self._window) + abs(self._wanted_window - self._lagging_window) < 1e-6:
            self._window = self._lagging_window = self._wanted_window

    def _go_beyond(self) -> None:
        """Appends segments that continue beyond the last target, slow down and return to the last target."""
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
        """Appends a cubic segment beyond the last target; joints stop at their limits.

        Args:
            length: Duration of the segment [ticks].
            way: Displacements [rad or m], keyed by joint index.
            first: Velocities [rad or m per tick] at the start, keyed by joint index.
            last: Velocities [rad or m per tick] at the end, keyed by joint index.
        """
        before = self._segments[-1]
        goal = {index: self._limited(index, value + way[index]) for index, value in before.goal.items()}
        stopped = {index for index, value in before.goal.items() if goal[index] != value + way[index]}
        slopes = tuple({i: 0.0 if i in stopped else value for i, value in each.items()} for each in (first, last))
        within = {index: value - before.goal[index] for index, value in goal.items()}
        self._segments.append(StreamSegment(before.end, length, goal, within, (slopes[0], slopes[1]), True))

    def _next_velocity(self, index: int) -> float:
        """Predicts the velocity towards the next target from the last three velocities; 0 if these are inconsistent."""
        if len(self._velocities) < 3:
            return 0.0
        first, second, third = (each[index] for each in self._velocities)
        change = _lesser(third - second, second - first)
        return third + change if abs(third - second) <= 2.0 * abs(change) else _lesser(second, third)


def _lesser(a: float, b: float) -> float:
    """Returns the number with the smaller magnitude if both have the same sign, else 0."""
    return 0.0 if a * b <= 0.0 else min(a, b, key=abs)


class TargetStreams:
    """Follows the position targets of one robot. Joints whose targets come together share a stream.

    Args:
        motors: The robot's motors.
        name: Name of the robot, for messages.
        dt_s: Length of a tick [s].
        smooth: Whether a moving average rounds the corners between targets.
        buffer_s: Delay of the jitter buffer [s]; 0 plays targets as they come.
    """

    def __init__(self, motors: Motors, name: str, dt_s: float, smooth: bool, buffer_s: float) -> None:
        self._motors, self._name, self._dt_s = motors, name, dt_s
        self._smooth, self._buffer_s = smooth, buffer_s
        self._quiet_until = 0
        """Tick from which the next late target is reported."""
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
        """Whether no target waits, and no stream moves its set points."""
        return not self._waiting and all(stream.rests for stream in self._streams.values())

    def follow(self, commands: Iterable[ResolvedCommand]) -> None:
        """Queues targets for the next tick."""
        for command in commands:
            self._waiting = coalesce(self._waiting, (command,))

    def drop(self, joints: Iterable[int]) -> None:
        """Drops each stream that contains one of `joints`; the other joints of these streams hold.

        Args:
            joints: Indices of joints that other code now drives.
        """
        dropped = set(joints)
        for key in [key for key in self._streams if key & dropped]:
            self._motors.release(self._streams.pop(key).joints - dropped)

    def clear(self) -> None:
        """Drops all streams and waiting targets; the joints hold."""
        self._waiting = ()
        self.drop(frozenset().union(*self._streams))

    def advance(self, tick: int, driven: frozenset[int]) -> None:
        """Advances all streams by a tick, and commands the motors.

        Args:
            tick: Number of the coming tick.
            driven: Indices of joints that a motion drives; targets of these joints are dropped.
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
