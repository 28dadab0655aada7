"""Conversion between messages and requests, goals and trajectories of the planner."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import rospy
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from custom_ros_tools.config import load_configs
from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.joint_states import values_in
from robot_model.geometry import Pose, normalized
from rpbi.ros.headers import world_frame
from rpbi_planning.constraints import PathConstraint, constraint_from
from rpbi_planning.goals import JointGoal, NamedGoal, PlanningGoal, PoseGoal, goal_from
from rpbi_planning.msg import MotionRequest

from .scene_topics import SceneTopics

MAX_TEXT = 20_000
"""Largest length of YAML in a request [characters]."""
SHORTEST_S = 1e-6
"""Shortest time between two points of a trajectory message; its times are whole nanoseconds [s]."""
GOALS = "joints, named, pose or goal"


def goal_in(request: MotionRequest, topics: SceneTopics) -> PlanningGoal:
    """Returns the goal of a request.

    Args:
        request: The request, which must have exactly one goal.
        topics: TF, for a pose in another frame than the world.

    Raises:
        InterfaceError: If the request has no goal or several, or if the goal is not valid.
        ValueError: Likewise.
    """
    given = [name for name in ("joints", "named", "link", "goal") if _is_given(getattr(request, name))]
    if len(given) != 1:
        got = ", ".join("pose" if name == "link" else name for name in given) or "none"
        raise InterfaceError(f"expected one goal ({GOALS}; a pose needs a link), got {got}")
    if request.named:
        return NamedGoal(request.named)
    if request.link:
        return _pose_goal(request, topics)
    if request.goal:
        return goal_from(_yaml(request.goal, "goal"))
    return JointGoal(positions_in(request.joints, "joints"))


def constraints_in(request: MotionRequest) -> tuple[PathConstraint, ...]:
    """Returns the path constraints of a request.

    Raises:
        InterfaceError: If a constraint is not valid.
        ValueError: Likewise.
    """
    found = []
    for i, text in enumerate(request.constraints):
        try:
            found.append(constraint_from(_yaml(text, f"constraints[{i}]")))
        except ValueError as error:
            raise InterfaceError(f"constraints[{i}]: {error}") from None
    return tuple(found)


def positions_in(message: JointState, field: str) -> dict[str, float]:
    """Returns the positions of a joint state [rad or m], indexed by joint.

    Args:
        message: The joint state.
        field: Field of the request, for errors.

    Raises:
        InterfaceError: If names are repeated, positions are missing or not finite.
    """
    try:
        values = values_in(message)
    except (InterfaceError, ValueError) as error:
        raise InterfaceError(f"{field}: {error}") from None
    if len(values.position) != len(values.names) or not all(map(math.isfinite, values.position)):
        raise InterfaceError(f"{field}: expected a finite position of each joint")
    return dict(zip(values.names, values.position))


def trajectory_message(joint_names: Sequence[str], trajectory: Any, stamp: rospy.Time | None = None) -> JointTrajectory:
    """Converts a timed trajectory of n joints to a message.

    Two points within `SHORTEST_S` would have the same time in a message, so the first of them is left out.

    Args:
        joint_names: Names of the n joints.
        trajectory: Has `times` of shape (k,) [s], and `positions`, `velocities` and `accelerations` of shape (k, n).
        stamp: Time of the start; by default at once.
    """
    message = JointTrajectory(joint_names=list(joint_names))
    message.header.stamp = stamp or rospy.Time()
    times = np.asarray(trajectory.times)
    kept = np.diff(times, append=math.inf) > SHORTEST_S
    motion = trajectory.positions, trajectory.velocities, trajectory.accelerations
    rows = zip(times[kept], *(np.asarray(each)[kept] for each in motion))
    message.points = [
        JointTrajectoryPoint(list(q), list(v), list(a), (), rospy.Duration.from_sec(float(time_s)))
        for time_s, q, v, a in rows
    ]
    return message


def _pose_goal(request: MotionRequest, topics: SceneTopics) -> PoseGoal:
    p, q = request.pose.pose.position, request.pose.pose.orientation
    numbers = (p.x, p.y, p.z, q.x, q.y, q.z, q.w, request.position_tolerance, request.orientation_tolerance)
    if not all(map(math.isfinite, numbers)) or not any(numbers[3:7]):
        raise InterfaceError("pose: expected finite numbers, and a quaternion that is not all zeros")
    if min(numbers[7:]) < 0.0:
        raise InterfaceError("position_tolerance, orientation_tolerance: expected at least 0")
    pose = Pose((p.x, p.y, p.z), normalized((q.x, q.y, q.z, q.w)))
    frame = request.pose.header.frame_id.strip("/")
    if frame and frame != world_frame():
        pose = topics.pose(frame, "pose") @ pose
    return PoseGoal(request.link, pose, request.position_tolerance, request.orientation_tolerance)


def _yaml(text: str, field: str) -> dict[str, Any]:
    if len(text) > MAX_TEXT:
        raise InterfaceError(f"{field}: expected at most {MAX_TEXT} characters, got {len(text)}")
    return load_configs(text, field, MAX_TEXT)


def _is_given(value: Any) -> bool:
    return bool(value.name or value.position) if isinstance(value, JointState) else bool(value.strip())
