"""Checks trajectories of single joints against the robot's limits, and splices them onto the present motion."""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from custom_ros_tools.errors import UnknownNameError
from rpbi.urdf.joints import Joint

from .polynomial import Polynomial, derivative, value_bounds, value_range
from .request import ErrorCode, TrajectoryPoint, TrajectoryRefusedError, TrajectoryRequest
from .trajectory import Knot, Trajectory

CURVE_SPEED_SLACK = 1.05
"""Largest accepted speed of a curve between two points, as a multiple of the joint's velocity limit.

A planner may sample a motion at the velocity limit every tenth of a second. A curve through these points exceeds the
limit by 1 or 2 %. The motors keep the limit in any case.
"""
CURVE_POSITION_SLACK = 1e-3
"""Largest accepted overshoot of a curve beyond a joint's limits, if the curve's points are within [rad or m]."""
ROUNDING = 1.0 + 1e-6
TURN = 2.0 * math.pi


class JointTrajectory(NamedTuple):
    """Trajectory of one joint; times are relative to the start of the trajectory.

    Attributes:
        joint: The joint.
        knots: Points of the trajectory.
        trajectory: Interpolation of the points.
    """

    joint: Joint
    knots: tuple[Knot, ...]
    trajectory: Trajectory

    def spliced_onto(self, current: Trajectory, start_s: float, from_s: float) -> Trajectory:
        """Returns a trajectory that equals `current` until a transition time and continues with this trajectory.

        Points up to the transition are left out: the joint moves from its state at the transition to the next point. A
        continuous joint takes the shorter rotation.

        Args:
            current: The present trajectory, in the world's time.
            start_s: The world's time [s] at which this trajectory's times are 0.
            from_s: The world's time [s] of the transition, before this trajectory's last point.

        Raises:
            TrajectoryRefusedError: If the motion to the next point would exceed the velocity or position limits.
        """
        before = current.sample(from_s)
        number = next(i for i, knot in enumerate(self.knots) if start_s + knot.time_s > from_s)
        knot = self.knots[number]
        offset = 0.0
        if self.joint.is_revolute and math.isinf(self.joint.upper):
            offset = TURN * round((before.position[0] - knot.position[0]) / TURN)
        shifted = self.trajectory.shifted(start_s, (offset,))
        next_knot = knot._replace(time_s=start_s + knot.time_s, position=(knot.position[0] + offset,))
        bridge = Trajectory.through([Knot(from_s, *before), next_knot])
        self._check_bridge(bridge, number, abs(before.velocity[0]))
        return current.spliced(bridge.spliced(shifted, next_knot.time_s), from_s)

    def _check_bridge(self, bridge: Trajectory, number: int, speed_now: float) -> None:
        polynomial, duration_s = bridge.segments[0].polynomials[0], bridge.end_s - bridge.start_s
        where = f"on the way to point {number}, which is {duration_s:.3g} s ahead"
        speed = max(map(abs, value_range(derivative(polynomial), duration_s)))
        if speed > max(self.joint.max_velocity * CURVE_SPEED_SLACK, speed_now * ROUNDING):
            raise _too_fast(self.joint, speed, where)
        low, high = value_range(polynomial, duration_s)
        start = polynomial[0]  # may be beyond the limits, if the joint was pushed there
        slack = CURVE_POSITION_SLACK
        if low < min(self.joint.lower, start) - slack or high > max(self.joint.upper, start) + slack:
            raise _swings_out(self.joint, low, high, where)


def validate_trajectory(
    request: TrajectoryRequest, joints: Mapping[str, Joint], may_be_partial: bool
) -> tuple[JointTrajectory, ...]:
    """Checks a trajectory as far as possible without the robot's state, and splits it into one trajectory per joint.

    Any thread may call this function.

    Args:
        request: The trajectory.
        joints: Joints that the follower drives, keyed by name.
        may_be_partial: Whether the trajectory may leave joints out.

    Raises:
        TrajectoryRefusedError: If a joint is unknown or missing, a number is invalid, or a limit is exceeded.
    """
    _check_names(request, joints, may_be_partial)
    _check_points(request)
    joint_trajectories = []
    for column, name in enumerate(request.joint_names if request.points else ()):
        joint = joints[name]
        for number, point in enumerate(request.points):
            _check_limits(joint, number, point, column)
        knots = tuple(_knot(point, column) for point in request.points)
        trajectory = Trajectory.through(knots)
        _check_curves(joint, trajectory)
        joint_trajectories.append(JointTrajectory(joint, knots, trajectory))
    return tuple(joint_trajectories)


def _knot(point: TrajectoryPoint, column: int) -> Knot:
    return Knot(
        point.time_s,
        (point.positions[column],),
        (point.velocities[column],) if point.velocities else None,
        (point.accelerations[column],) if point.accelerations else None,
    )


def _check_names(request: TrajectoryRequest, joints: Mapping[str, Joint], may_be_partial: bool) -> None:
    names = request.joint_names
    for name in names:
        if name not in joints:
            raise TrajectoryRefusedError(str(UnknownNameError("joint", name, joints)), ErrorCode.INVALID_JOINTS)
    if len(set(names)) != len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise TrajectoryRefusedError(f"joint '{twice}' is named more than once", ErrorCode.INVALID_JOINTS)
    missing = [name for name in joints if name not in names]
    if request.points and (missing and not may_be_partial or not names):
        message = f"expected all joints, since allow_partial_joints_goal is off; missing: {', '.join(missing)}"
        raise TrajectoryRefusedError(message, ErrorCode.INVALID_JOINTS)


def _check_points(request: TrajectoryRequest) -> None:
    count, previous_s = len(request.joint_names), -math.inf
    for number, point in enumerate(request.points):
        if not previous_s < point.time_s:
            message = f"point {number}: times must increase strictly, got {point.time_s:g} s after {previous_s:g} s"
            raise TrajectoryRefusedError(message)
        previous_s = point.time_s
        if point.accelerations and not point.velocities:
            raise TrajectoryRefusedError(f"point {number}: accelerations need velocities, got none")
        for kind, values in zip(point._fields[1:], point[1:]):
            if len(values) != count and (values or kind == "positions"):
                raise TrajectoryRefusedError(f"point {number}: expected {kind} of {count} joints, got {len(values)}")
            for name, value in zip(request.joint_names, values):
                if not math.isfinite(value):
                    message = f"point {number}: {kind} must be finite, got {value} for joint '{name}'"
                    raise TrajectoryRefusedError(message)


def _check_limits(joint: Joint, number: int, point: TrajectoryPoint, column: int) -> None:
    position = point.positions[column]
    if not joint.allows(position):
        raise TrajectoryRefusedError(f"point {number}: {joint.limit_violation(position)}")
    speed = abs(point.velocities[column]) if point.velocities else 0.0
    if speed > joint.max_velocity * ROUNDING:
        raise _too_fast(joint, speed, f"at point {number}")


def _check_curves(joint: Joint, trajectory: Trajectory) -> None:
    """Checks speeds and positions between the points against the joint's limits."""
    positions = [segment.polynomials[0] for segment in trajectory.segments]
    velocities = [derivative(polynomial) for polynomial in positions]
    durations_s = np.diff([*(segment.start_s for segment in trajectory.segments), trajectory.end_s]).tolist()
    for number in _beyond(velocities, durations_s, -joint.max_velocity, joint.max_velocity):
        where = f"between points {number} and {number + 1}"
        slack = CURVE_SPEED_SLACK if any(positions[number][2:]) else ROUNDING
        speed = max(map(abs, value_range(velocities[number], durations_s[number])))
        if speed > joint.max_velocity * slack:
            raise _too_fast(joint, speed, where)
    for number in _beyond(positions, durations_s, joint.lower, joint.upper):
        low, high = value_range(positions[number], durations_s[number])
        if low < joint.lower - CURVE_POSITION_SLACK or high > joint.upper + CURVE_POSITION_SLACK:
            raise _swings_out(joint, low, high, f"between points {number} and {number + 1}")


def _beyond(polynomials: Sequence[Polynomial], durations_s: Sequence[float], lower: float, upper: float) -> list[int]:
    """Returns the indices of polynomials that may leave a range and therefore need an exact check."""
    low, high = value_bounds(polynomials, durations_s)
    return [int(number) for number in ((low < lower) | (high > upper)).nonzero()[0]]


def _too_fast(joint: Joint, speed: float, where: str) -> TrajectoryRefusedError:
    limit = f"its limit is {joint.max_velocity:.6g} {joint.unit}/s"
    return TrajectoryRefusedError(f"joint '{joint.name}' would need {speed:.6g} {joint.unit}/s {where}; {limit}")


def _swings_out(joint: Joint, low: float, high: float, where: str) -> TrajectoryRefusedError:
    message = joint.limit_violation(low if low < joint.lower else high)
    return TrajectoryRefusedError(f"{message}, where the curve swings {where}")
