"""Trajectories and the states of their followers as messages."""

from collections.abc import Sequence
from typing import Any

import genpy
from control_msgs.msg import JointTrajectoryControllerState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from rpbi.control.trajectories.request import GoalTolerances, JointTolerance, TrajectoryPoint, TrajectoryRequest
from rpbi.control.trajectories.trajectory import TrajectoryStateSample
from rpbi.ros.headers import to_ros_time

CONTROLLER = "joint_trajectory_controller"
"""Namespace of a trajectory follower below `rpbi/NAME/`."""


def trajectory_request(message: JointTrajectory) -> TrajectoryRequest:
    """Returns the request of a message; efforts beside positions are ignored."""
    points = tuple(
        TrajectoryPoint(
            point.time_from_start.to_sec(), tuple(point.positions), tuple(point.velocities), tuple(point.accelerations)
        )
        for point in message.points
    )
    return TrajectoryRequest(tuple(message.joint_names), points, message.header.stamp.to_nsec())


def goal_tolerances(goal: Any) -> GoalTolerances:
    """Returns the tolerances of a control_msgs/FollowJointTrajectoryGoal; accelerations are not looked at."""
    return GoalTolerances(
        _tolerances(goal.path_tolerance), _tolerances(goal.goal_tolerance), goal.goal_time_tolerance.to_sec()
    )


def state_message(state: TrajectoryStateSample, stamp_ns: int) -> JointTrajectoryControllerState:
    """Returns the message of a follower's state."""
    return fill_state(JointTrajectoryControllerState(), state, stamp_ns)


def fill_state(message: Any, state: TrajectoryStateSample, stamp_ns: int) -> Any:
    """Fills in a message with the fields of a follower's state, and returns it."""
    desired = state.desired
    since_start = genpy.Duration.from_sec(state.time_from_start_s)
    message.header.stamp = to_ros_time(stamp_ns)
    message.joint_names = state.joint_names
    message.desired = JointTrajectoryPoint(desired.position, desired.velocity, desired.acceleration, (), since_start)
    message.actual = JointTrajectoryPoint(state.position, state.velocity, (), (), since_start)
    off = _difference(desired.position, state.position), _difference(desired.velocity, state.velocity)
    message.error = JointTrajectoryPoint(*off, (), (), since_start)
    return message


def _difference(a: Sequence[float], b: Sequence[float]) -> list[float]:
    return [x - y for x, y in zip(a, b, strict=True)]


def _tolerances(messages: Sequence[Any]) -> dict[str, JointTolerance]:
    return {message.name: JointTolerance(message.position, message.velocity) for message in messages}
