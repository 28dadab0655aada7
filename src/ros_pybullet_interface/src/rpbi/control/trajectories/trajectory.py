"""Joint trajectories: piecewise polynomials through knots.

Trajectories are sampled at every tick in plain Python, which is faster than NumPy for the few joints of a robot.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from typing import NamedTuple

from .polynomial import Polynomial, cubic, line, quintic


class Knot(NamedTuple):
    """A point that a trajectory of n joints passes through.

    Attributes:
        time_s: Time [s].
        position: n positions [rad or m].
        velocity: n velocities [rad/s or m/s]; None if not prescribed.
        acceleration: n accelerations [rad/s^2 or m/s^2]; None if not prescribed. Accelerations need velocities.
    """

    time_s: float
    position: tuple[float, ...]
    velocity: tuple[float, ...] | None = None
    acceleration: tuple[float, ...] | None = None


class DesiredState(NamedTuple):
    """Desired state of n joints at one time.

    Attributes:
        position: n positions [rad or m].
        velocity: n velocities [rad/s or m/s].
        acceleration: n accelerations [rad/s^2 or m/s^2].
    """

    position: tuple[float, ...]
    velocity: tuple[float, ...]
    acceleration: tuple[float, ...]


class Segment(NamedTuple):
    """The part of a trajectory between two knots.

    Attributes:
        start_s: Start time [s].
        origin_s: Time [s] at which the argument of the polynomials is 0, at or before `start_s`.
        polynomials: One polynomial for each of n joints.
    """

    start_s: float
    origin_s: float
    polynomials: tuple[Polynomial, ...]


class Trajectory:
    """The motion of n joints through knots; immutable.

    A segment between two knots is a quintic if both knots have accelerations, else a cubic if both have velocities,
    else a line. Before the first knot and after the last knot the joints are at rest.

    Attributes:
        segments: Segments in the order of time; a single segment at rest if there is only one knot.
        start_s: Time of the first knot [s].
        end_s: Time of the last knot [s].
        goal: The last knot's positions [rad or m].
    """

    __slots__ = ("_before", "_end", "_starts", "end_s", "goal", "segments", "start_s")

    def __init__(self, segments: Sequence[Segment], end_s: float, goal: tuple[float, ...]) -> None:
        self.segments, self.end_s, self.goal = tuple(segments), end_s, goal
        self._starts = tuple(segment.start_s for segment in segments)
        self.start_s = self._starts[0]
        still = (0.0,) * len(goal)
        self._before = DesiredState(_evaluated(segments[0], self.start_s).position, still, still)
        self._end = DesiredState(goal, still, still)

    @classmethod
    def through(cls, knots: Sequence[Knot]) -> Trajectory:
        """Creates the trajectory through knots.

        Args:
            knots: At least one knot. Times increase strictly, all numbers are finite, and all knots have the same
                number of joints.

        Raises:
            ValueError: If the knots violate these conditions.
        """
        _check(knots)
        segments = [_segment(before, after) for before, after in zip(knots, knots[1:])]
        last = knots[-1]
        return cls(segments or [_standing(last.time_s, last.position)], last.time_s, last.position)

    def sample(self, time_s: float) -> DesiredState:
        """Returns the desired state of the joints at a time [s].

        Before the start, the joints rest at the first knot. From the end on, they rest exactly at the last knot.
        """
        if time_s >= self.end_s:
            return self._end
        if time_s < self.start_s:
            return self._before
        return _evaluated(self.segments[bisect_right(self._starts, time_s) - 1], time_s)

    def spliced(self, new: Trajectory, at_s: float) -> Trajectory:
        """Returns a trajectory that equals this trajectory until a transition and `new` from then on.

        Args:
            new: The other trajectory, of the same joints.
            at_s: Time of the transition [s].
        """
        if at_s <= self.start_s:
            return new
        kept = [segment for segment in self.segments if segment.start_s < at_s]
        if self.end_s < at_s:
            kept.append(_standing(self.end_s, self.goal))
        if at_s < new.start_s:
            taken = [_standing(at_s, new.sample(at_s).position), *new.segments]
        else:
            first, *rest = new.since(at_s).segments
            taken = [first._replace(start_s=at_s), *rest]
        return Trajectory(kept + taken, max(at_s, new.end_s), new.goal)

    def shifted(self, by_s: float, by_position: Sequence[float]) -> Trajectory:
        """Returns the trajectory shifted in time and position.

        Args:
            by_s: Time to add [s].
            by_position: n positions to add [rad or m].
        """
        segments = [
            Segment(
                segment.start_s + by_s,
                segment.origin_s + by_s,
                tuple((c[0] + offset, *c[1:]) for c, offset in zip(segment.polynomials, by_position)),
            )
            for segment in self.segments
        ]
        goal = tuple(position + offset for position, offset in zip(self.goal, by_position))
        return Trajectory(segments, self.end_s + by_s, goal)

    def since(self, time_s: float) -> Trajectory:
        """Returns the trajectory without the segments that end before a time [s]."""
        first = max(bisect_right(self._starts, time_s) - 1, 0)
        return self if first == 0 else Trajectory(self.segments[first:], self.end_s, self.goal)


def minimum_jerk(start: Sequence[float], goal: Sequence[float], start_s: float, duration_s: float) -> Trajectory:
    """Returns the minimum-jerk motion from rest to rest (Flash and Hogan, 1985).

    The motion is the quintic with zero velocity and acceleration at both ends. The peak speed is 15/8 of the mean
    speed.

    Args:
        start: n start positions [rad or m].
        goal: n goal positions [rad or m].
        start_s: Start time [s].
        duration_s: Duration [s], more than 0.

    Raises:
        ValueError: If the numbers of positions differ, a number is not finite, or the duration is not positive.
    """
    still = (0.0,) * len(start)
    return Trajectory.through(
        [Knot(start_s, tuple(start), still, still), Knot(start_s + duration_s, tuple(goal), still, still)]
    )


def _evaluated(segment: Segment, time_s: float) -> DesiredState:
    t = time_s - segment.origin_s
    position, velocity, acceleration = [], [], []
    for c0, c1, c2, c3, c4, c5 in segment.polynomials:
        position.append(c0 + t * (c1 + t * (c2 + t * (c3 + t * (c4 + t * c5)))))
        velocity.append(c1 + t * (2.0 * c2 + t * (3.0 * c3 + t * (4.0 * c4 + t * 5.0 * c5))))
        acceleration.append(2.0 * c2 + t * (6.0 * c3 + t * (12.0 * c4 + t * 20.0 * c5)))
    return DesiredState(tuple(position), tuple(velocity), tuple(acceleration))


def _standing(start_s: float, position: Sequence[float]) -> Segment:
    return Segment(start_s, start_s, tuple((place, 0.0, 0.0, 0.0, 0.0, 0.0) for place in position))


def _segment(before: Knot, after: Knot) -> Segment:
    duration_s = after.time_s - before.time_s
    positions = zip(before.position, after.position)
    if before.velocity is None or after.velocity is None:
        polynomials = tuple(line(duration_s, *p) for p in positions)
    elif before.acceleration is None or after.acceleration is None:
        polynomials = tuple(cubic(duration_s, *p, *v) for p, v in zip(positions, zip(before.velocity, after.velocity)))
    else:
        velocities = zip(before.velocity, after.velocity)
        accelerations = zip(before.acceleration, after.acceleration)
        polynomials = tuple(quintic(duration_s, *p, *v, *a) for p, v, a in zip(positions, velocities, accelerations))
    return Segment(before.time_s, before.time_s, polynomials)


def _check(knots: Sequence[Knot]) -> None:
    """Checks knots; raises a ValueError that names the first invalid knot."""
    if not knots:
        raise ValueError("a trajectory needs at least one knot")
    width = len(knots[0].position)
    previous_s = -math.inf
    for number, knot in enumerate(knots):
        if not previous_s < knot.time_s < math.inf:
            raise ValueError(f"knot {number}: expected a time after {previous_s:g} s, got {knot.time_s:g} s")
        previous_s = knot.time_s
        if knot.acceleration is not None and knot.velocity is None:
            raise ValueError(f"knot {number}: has accelerations but no velocities")
        for kind, values in zip(knot._fields[1:], knot[1:]):
            if values is not None and len(values) != width:
                raise ValueError(f"knot {number}: expected {width} values of {kind}, got {len(values)}")
            if values is not None and not all(map(math.isfinite, values)):
                raise ValueError(f"knot {number}: {kind} is not finite: {', '.join(f'{v:g}' for v in values)}")


class TrajectoryStateSample(NamedTuple):
    """Desired and measured state of the joints of a trajectory follower.

    Attributes:
        name: Name of the robot.
        joint_names: n joint names.
        desired: Desired state of the n joints, as returned by `TrajectoryFollower.desired`.
        position: n measured positions [rad or m].
        velocity: n measured velocities [rad/s or m/s].
        time_from_start_s: Time since the start of the trajectory [s]; 0 without a trajectory.
    """

    name: str
    joint_names: tuple[str, ...]
    desired: DesiredState
    position: tuple[float, ...]
    velocity: tuple[float, ...]
    time_from_start_s: float
