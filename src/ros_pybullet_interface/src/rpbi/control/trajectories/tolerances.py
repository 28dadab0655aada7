"""Tolerances of joints that follow a trajectory."""

import math
from collections.abc import Mapping
from typing import NamedTuple

from custom_ros_tools.errors import UnknownNameError
from rpbi.urdf.joints import Joint

from .config import JointConstraints, TrajectoryConstraints
from .request import ErrorCode, GoalTolerances, JointTolerance, TrajectoryRefusedError


class Tolerances(NamedTuple):
    """Tolerances of joints; infinity is no limit.

    Attributes:
        path: On the way, by joint index.
        goal: At the end, by joint index.
        goal_time_s: Longest time after the end to reach the goal [s].
    """

    path: Mapping[int, JointTolerance]
    goal: Mapping[int, JointTolerance]
    goal_time_s: float


def resolved_tolerances(
    given: GoalTolerances, constraints: TrajectoryConstraints, joints: Mapping[str, Joint]
) -> Tolerances:
    """Returns the tolerances of a goal, with those of the configuration where it has none of its own.

    Raises:
        TrajectoryRefusedError: If it names an unknown joint, or a number is not finite.
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
    """Returns the first limit that is not 0: given, configured, default; below 0 is none."""
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
