"""Requests to follow trajectories, with points, tolerances and error codes."""

import math
from collections.abc import Mapping
from enum import IntEnum
from typing import NamedTuple

from custom_ros_tools.errors import InterfaceError, UnknownNameError
from rpbi.urdf.joints import Joint

from .config import JointConstraints, TrajectoryConstraints


class ErrorCode(IntEnum):
    """Outcome of a trajectory, with the numbers of control_msgs/FollowJointTrajectoryResult."""

    SUCCESSFUL = 0
    INVALID_GOAL = -1
    INVALID_JOINTS = -2
    OLD_HEADER_TIMESTAMP = -3
    PATH_TOLERANCE_VIOLATED = -4
    GOAL_TOLERANCE_VIOLATED = -5


class TrajectoryRefusedError(InterfaceError):
    """A trajectory request was refused before any joint moved."""

    def __init__(self, message: str, code: ErrorCode = ErrorCode.INVALID_GOAL) -> None:
        self.code = code
        super().__init__(message)


class TrajectoryPoint(NamedTuple):
    """Desired state of n joints at one time.

    Attributes:
        time_s: Time from the start of the trajectory [s].
        positions: n positions [rad or m].
        velocities: n velocities [rad/s or m/s], or empty.
        accelerations: n accelerations [rad/s^2 or m/s^2], or empty.
    """

    time_s: float
    positions: tuple[float, ...]
    velocities: tuple[float, ...] = ()
    accelerations: tuple[float, ...] = ()


class JointTolerance(NamedTuple):
    """Tolerances of one joint. In a request, 0 selects the configured tolerance, and a negative number sets no limit.

    Attributes:
        position: Maximum position error [rad or m].
        velocity: Maximum velocity error [rad/s or m/s].
    """

    position: float = 0.0
    velocity: float = 0.0


class TrajectoryRequest(NamedTuple):
    """A trajectory to follow.

    Attributes:
        joint_names: n joint names, in any order.
        points: Points with increasing times; empty to stop the joints and hold.
        stamp_ns: Start time, in the world's stamps [ns]; 0 to start at once.
    """

    joint_names: tuple[str, ...]
    points: tuple[TrajectoryPoint, ...]
    stamp_ns: int = 0


class GoalTolerances(NamedTuple):
    """Tolerances of an action goal, as requested.

    Attributes:
        path: Tolerances before the end of the trajectory, keyed by joint name.
        goal: Tolerances at the end, keyed by joint name.
        goal_time_s: Time [s] allowed for reaching the goal after the trajectory's end. 0 selects the configured time, a
            negative number sets no limit.
    """

    path: Mapping[str, JointTolerance] = {}
    goal: Mapping[str, JointTolerance] = {}
    goal_time_s: float = 0.0


class Tolerances(NamedTuple):
    """Tolerances of joints, with configured values filled in; infinity means no limit.

    Attributes:
        path: Tolerances before the end of the trajectory, keyed by joint index.
        goal: Tolerances at the end, keyed by joint index.
        goal_time_s: Time [s] allowed for reaching the goal after the trajectory's end.
    """

    path: Mapping[int, JointTolerance]
    goal: Mapping[int, JointTolerance]
    goal_time_s: float


def resolved_tolerances(
    given: GoalTolerances, constraints: TrajectoryConstraints, joints: Mapping[str, Joint]
) -> Tolerances:
    """Completes the tolerances of a goal with configured tolerances, and resolves joint names to indices.

    Args:
        given: Tolerances as requested.
        constraints: Configured tolerances.
        joints: Joints that the follower drives, keyed by name.

    Raises:
        TrajectoryRefusedError: If `given` names an unknown joint, or a number is not finite.
    """
    _check(given, joints)
    path, goal = {}, {}
    for name, joint in joints.items():
        configured = constraints.by_joint.get(name, JointConstraints())
        path[joint.index] = _resolved(given.path.get(name), configured.trajectory, 0.0)
        goal[joint.index] = _resolved(given.goal.get(name), configured.goal, constraints.stopped_velocity_tolerance)
    return Tolerances(path, goal, _limit(given.goal_time_s, constraints.goal_time, 0.0))


def _resolved(given: JointTolerance | None, position: float, velocity: float) -> JointTolerance:
    given = given or JointTolerance()
    return JointTolerance(_limit(given.position, position, math.inf), _limit(given.velocity, velocity, math.inf))


def _limit(given: float, configured: float, default: float) -> float:
    """Returns infinity if `given` is negative, else the first non-zero value of `given`, `configured`, `default`."""
    return math.inf if given < 0.0 else given or configured or default


def _check(given: GoalTolerances, joints: Mapping[str, Joint]) -> None:
    for kind, tolerances in (("path_tolerance", given.path), ("goal_tolerance", given.goal)):
        for name, tolerance in tolerances.items():
            if name not in joints:
                message = f"{kind}: {UnknownNameError('joint', name, joints)}"
                raise TrajectoryRefusedError(message, ErrorCode.INVALID_JOINTS)
            if not all(map(math.isfinite, tolerance)):
                message = f"{kind}: must be finite, got {', '.join(map(str, tolerance))} for joint '{name}'"
                raise TrajectoryRefusedError(message)
