"""Executes trajectories by an action of the type FollowJointTrajectory, and stops along the path."""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence
from typing import Any

import actionlib
import numpy as np
import rospy
from control_msgs.msg import FollowJointTrajectoryAction, FollowJointTrajectoryGoal, FollowJointTrajectoryResult

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.action_client import ActionClient
from rpbi_planning.braking import SampledMotion, braked

from .motion_messages import trajectory_message

SERVER_S = 5.0
"""Longest time to wait for the action, in wall time [s]."""
LATENCIES_S = (0.1, 0.3)
"""Times from the decision to stop to the beginning of the braking [s], in which the message must arrive; the second is
for a second attempt. Trajectories begin after the first.
"""
STOPPED_S = 5.0
"""Longest time to wait for the end of the braking beyond its duration [s]."""


class TrajectoryClient:
    """Sends trajectories to a controller or a driver, one at a time.

    Args:
        action: Name of the action.
        joint_names: Names of the n joints.
        acceleration: Largest acceleration while braking, of each joint [rad/s^2 or m/s^2].
    """

    def __init__(self, action: str, joint_names: Sequence[str], acceleration: float) -> None:
        self._name = rospy.resolve_name(action)
        self._joint_names, self._acceleration = tuple(joint_names), acceleration
        self._client = ActionClient(self._name, FollowJointTrajectoryAction)
        self._ended = threading.Event()
        self._trajectory: SampledMotion | None = None
        self._begin = rospy.Time()
        self._result: tuple[int, FollowJointTrajectoryResult] | None = None

    def start(self, joint_names: Sequence[str], trajectory: Any, present: Mapping[str, float]) -> None:
        """Starts to follow a trajectory.

        Args:
            joint_names: Names of the joints that move.
            trajectory: Has `times` [s], and `positions`, `velocities` and `accelerations` of these joints.
            present: Present positions of all joints [rad or m]; joints that do not move keep them.

        Raises:
            InterfaceError: If the action does not answer, or moves other joints.
        """
        if more := set(joint_names) - set(self._joint_names):
            expected = f"group: expected joints of {self._name} ({', '.join(self._joint_names)})"
            raise InterfaceError(f"{expected}, got '{min(more)}'")
        if not self._client.wait_for_server(_duration(SERVER_S)):
            raise InterfaceError(f"no action {self._name} answers")
        self._trajectory = self._of_all_joints(joint_names, trajectory, present)
        self._begin = rospy.Time.now() + _duration(LATENCIES_S[0])
        self._send(self._trajectory, self._begin)

    @property
    def elapsed_s(self) -> float:
        """Time since the start of the trajectory [s]."""
        assert self._trajectory is not None
        return min(max((rospy.Time.now() - self._begin).to_sec(), 0.0), self._trajectory.duration_s)

    def wait(self, timeout_s: float) -> bool:
        """Waits for the end of the motion, in wall time [s], and returns whether it has ended."""
        return self._ended.wait(timeout_s)

    @property
    def fault(self) -> str:
        """Reason why the motion failed; empty after a success."""
        if self._result is None:
            return f"{self._name} does not answer"
        state, result = self._result
        if state == actionlib.GoalStatus.SUCCEEDED:
            return ""
        return result.error_string or self._client.get_goal_status_text() or f"the goal ended with status {state}"

    def stop(self) -> None:
        """Brakes along the path, and waits until the robot is at rest. If that fails, cancels the motion.

        Raises:
            InterfaceError: If the robot does not brake along the path.
        """
        assert self._trajectory is not None
        for latency_s in LATENCIES_S:
            from_s = self.elapsed_s + latency_s
            if self._ended.is_set() or from_s >= self._trajectory.duration_s:
                break  # the trajectory itself ends at rest
            self._send(braked(self._trajectory, from_s, self._acceleration), self._begin + _duration(from_s))
            if self._is_at_rest():
                return
        if not self._is_at_rest():
            self._client.cancel_all_goals()
            raise InterfaceError(f"{self._name}: the robot cannot brake along its path: {self.fault}; cancelled")

    def _is_at_rest(self) -> bool:
        """Waits for the end of the motion, and returns whether it ended at rest."""
        assert self._trajectory is not None
        end = rospy.Time.now() + _duration(self._trajectory.duration_s + STOPPED_S)
        while not self._ended.wait(0.1):
            if rospy.Time.now() > end or rospy.is_shutdown():
                return False
        return not self.fault

    def _of_all_joints(
        self, joint_names: Sequence[str], trajectory: Any, present: Mapping[str, float]
    ) -> SampledMotion:
        still = np.array([present[name] for name in self._joint_names])
        columns = [self._joint_names.index(name) for name in joint_names]
        values = [np.tile(each, (len(trajectory.times), 1)) for each in (still, 0.0 * still, 0.0 * still)]
        for all_joints, moved in zip(values, (trajectory.positions, trajectory.velocities, trajectory.accelerations)):
            all_joints[:, columns] = moved
        return SampledMotion(np.asarray(trajectory.times), *values)

    def _send(self, trajectory: SampledMotion, stamp: rospy.Time) -> None:
        self._ended.clear()
        self._result = None
        goal = FollowJointTrajectoryGoal(trajectory=trajectory_message(self._joint_names, trajectory, stamp))
        self._client.send_goal(goal, done_cb=self._on_done)

    def _on_done(self, state: int, result: FollowJointTrajectoryResult) -> None:
        self._result = state, result
        self._ended.set()


def _duration(time_s: float) -> rospy.Duration:
    return rospy.Duration.from_sec(float(time_s))
