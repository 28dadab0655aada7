"""Requests to follow trajectories, and reasons to refuse them."""

from collections.abc import Mapping
from enum import IntEnum
from typing import NamedTuple

from custom_ros_tools.errors import InterfaceError


class ErrorCode(IntEnum):
    """Outcome of a trajectory; numbers of control_msgs/FollowJointTrajectoryResult."""

    SUCCESSFUL = 0
    INVALID_GOAL = -1
    INVALID_JOINTS = -2
    OLD_HEADER_TIMESTAMP = -3
    PATH_TOLERANCE_VIOLATED = -4
    GOAL_TOLERANCE_VIOLATED = -5


class TrajectoryRefusedError(InterfaceError):
    """A trajectory cannot be followed; nothing has moved."""

    def __init__(self, message: str, code: ErrorCode = ErrorCode.INVALID_GOAL) -> None:
        self.code = code
        super().__init__(message)


class TrajectoryPoint(NamedTuple):
    """Desired state of n joints at one time.

    Attributes:
        time_s: Time from the start of the trajectory [s].
        positions: n positions [rad or m].
        velocities: n velocities [rad/s or m/s], or none.
        accelerations: n accelerations [rad/s^2 or m/s^2], or none.
    """

    time_s: float
    positions: tuple[float, ...]
    velocities: tuple[float, ...] = ()
    accelerations: tuple[float, ...] = ()


class JointTolerance(NamedTuple):
    """Tolerance of one joint; 0 is the configured one, less than 0 is no limit.

    Attributes:
        position: Distance [rad or m].
        velocity: Difference of velocities [rad/s or m/s].
    """

    position: float = 0.0
    velocity: float = 0.0


class TrajectoryRequest(NamedTuple):
    """A trajectory to follow.

    Attributes:
        joint_names: n names, in any order.
        points: Its points, with increasing times; without any, the joints stop and hold.
        stamp_ns: Stamp of its start in the world's stamps [ns]; 0 is now.
    """

    joint_names: tuple[str, ...]
    points: tuple[TrajectoryPoint, ...]
    stamp_ns: int = 0


class GoalTolerances(NamedTuple):
    """Tolerances of a goal.

    Attributes:
        path: Tolerances on the way, by name of joint.
        goal: Tolerances at the end, by name of joint.
        goal_time_s: Longest time after the end to reach the goal [s]; 0 is the configured one, less than 0 is no limit.
    """

    path: Mapping[str, JointTolerance] = {}
    goal: Mapping[str, JointTolerance] = {}
    goal_time_s: float = 0.0
