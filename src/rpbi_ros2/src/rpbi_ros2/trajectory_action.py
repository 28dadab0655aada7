"""Follows a trajectory that the companion sends, by the action of the simulated robot."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import actionlib
import rospy
from control_msgs.msg import (
    FollowJointTrajectoryAction,
    FollowJointTrajectoryFeedback,
    FollowJointTrajectoryGoal,
    FollowJointTrajectoryResult,
    JointTolerance,
)
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.action_client import ActionClient

SERVER_S = 5.0
"""Longest time to wait for the robot's action, in wall time [s]."""
FEEDBACK_S = 0.05
"""Shortest time between two feedbacks, in wall time [s]."""
QUANTITIES = ("positions", "velocities", "accelerations", "effort")
TOLERANCES = ("position", "velocity", "acceleration")
Answer = dict[str, Any]
Rows = Iterable[Mapping[str, Any]]


class RequestedMotion:
    """One motion along a trajectory.

    Args:
        on_feedback: Function that gets feedback as a part of an answer.
    """

    def __init__(self, on_feedback: Callable[[Answer], None]) -> None:
        self._on_feedback = on_feedback
        self._ended = threading.Event()
        self._result: tuple[int, FollowJointTrajectoryResult] | None = None
        self._sent_s = 0.0

    def cancel(self) -> None:
        """Ends the motion early."""
        self._ended.set()

    def run(self, robot: str, **goal: Any) -> Answer:
        """Sends the trajectory to a robot, and waits for the end of the motion.

        Args:
            robot: Name of the robot.
            goal: Fields of the goal, see `goal_of`.

        Raises:
            InterfaceError: If the robot has no such action, or does not answer.
        """
        wanted = goal_of(**goal)
        name = rospy.resolve_name(f"rpbi/{robot}/joint_trajectory_controller/follow_joint_trajectory")
        client = ActionClient(name, FollowJointTrajectoryAction)
        if not client.wait_for_server(rospy.Duration.from_sec(SERVER_S)):
            raise InterfaceError(f"no action {name} answers")
        client.send_goal(wanted, done_cb=self._on_done, feedback_cb=self._on_action_feedback)
        self._ended.wait()
        if self._result is None:
            self._ended.clear()
            client.cancel_goal()
            self._ended.wait(SERVER_S)
        if self._result is None:
            raise InterfaceError(f"{name} does not end")
        state, result = self._result
        return {
            "success": state == actionlib.GoalStatus.SUCCEEDED,
            "message": result.error_string,
            "error_code": result.error_code,
            "cancelled": state in (actionlib.GoalStatus.PREEMPTED, actionlib.GoalStatus.RECALLED),
        }

    def _on_done(self, state: int, result: FollowJointTrajectoryResult) -> None:
        self._result = state, result
        self._ended.set()

    def _on_action_feedback(self, feedback: FollowJointTrajectoryFeedback) -> None:
        now_s = time.monotonic()
        if now_s < self._sent_s + FEEDBACK_S:
            return
        self._sent_s = now_s
        points = {name: _numbers(getattr(feedback, name)) for name in ("desired", "actual", "error")}
        self._on_feedback({"feedback": {"joint_names": list(feedback.joint_names), **points}})


def goal_of(
    joint_names: list[str],
    points: Rows,
    stamp_s: float = 0.0,
    path_tolerance: Rows = (),
    goal_tolerance: Rows = (),
    goal_time_tolerance_s: float = 0.0,
) -> FollowJointTrajectoryGoal:
    """Makes the goal of the action.

    Args:
        joint_names: Names of the joints.
        points: Points with `time_from_start_s` [s], `positions` and other quantities of each joint.
        stamp_s: ROS time of the start [s]; 0: at once.
        path_tolerance: `name`, `position`, `velocity` and `acceleration` for each joint on the way.
        goal_tolerance: The same at the goal.
        goal_time_tolerance_s: Longest delay of the goal [s].

    Raises:
        TypeError: If a value has a wrong type.
        ValueError: Likewise.
    """
    trajectory = JointTrajectory(joint_names=[*map(str, joint_names)])
    trajectory.header.stamp = rospy.Time.from_sec(float(stamp_s))
    for point in points:
        values = {name: [*map(float, point.get(name, ()))] for name in QUANTITIES}
        after = rospy.Duration.from_sec(float(point["time_from_start_s"]))
        trajectory.points.append(JointTrajectoryPoint(**values, time_from_start=after))
    return FollowJointTrajectoryGoal(
        trajectory,
        [_tolerance(each) for each in path_tolerance],
        [_tolerance(each) for each in goal_tolerance],
        rospy.Duration.from_sec(float(goal_time_tolerance_s)),
    )


def _tolerance(row: Mapping[str, Any]) -> JointTolerance:
    return JointTolerance(str(row["name"]), *(float(row.get(name, 0.0)) for name in TOLERANCES))


def _numbers(point: JointTrajectoryPoint) -> Answer:
    values = {name: list(getattr(point, name)) for name in QUANTITIES}
    return {**values, "time_from_start_s": point.time_from_start.to_sec()}
