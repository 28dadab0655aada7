"""A world with an arm that follows trajectories, and a client of its action."""

from __future__ import annotations

import math
import threading
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import actionlib
import rospy
from actionlib_msgs.msg import GoalStatus
from control_msgs.msg import FollowJointTrajectoryAction, FollowJointTrajectoryGoal, JointTolerance
from node_world import main_config
from ros_system import sends_to_us, wait_until
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
from worlds import iiwa

from ros_pybullet_interface.srv import GetStateHash

JOINTS = [f"lbr_iiwa_joint_{number}" for number in range(1, 8)]
CONTROLLER = "/rpbi/iiwa/joint_trajectory_controller"
HOME = {"initial_joint_position": {"lbr_iiwa_joint_2": 30.0, "lbr_iiwa_joint_4": -60.0}}
START = [0.0, math.radians(30.0), 0.0, math.radians(-60.0), 0.0, 0.0, 0.0]


def open_world(
    ros: Any,
    folder: Path,
    use_sim_time: bool = True,
    controller: dict[str, Any] | None = None,
    **main: Any,
) -> SimpleNamespace:
    """Starts a world with an iiwa that follows trajectories; returns what tests talk to.

    Args:
        ros: The nodes of the test.
        folder: Where files go.
        use_sim_time: Whether stamps are simulated time.
        controller: Keys of the controller.
        **main: Keys of the main file.
    """
    robot = iiwa(joint_trajectory_controller=controller or {}, joint_state_publisher_hz=1000, **HOME)
    process = ros.simulator(main_config(folder, robots=(robot,), **main), use_sim_time=use_sim_time)
    states = ros.listen("/rpbi/iiwa/joint_states", JointState)
    rospy.set_param("actionlib_client_pub_queue_size", 1000)  # else a burst of more than 10 goals loses some
    client = actionlib.ActionClient(f"{CONTROLLER}/follow_joint_trajectory", FollowJointTrajectoryAction)
    assert client.wait_for_server(rospy.Duration(60.0))
    for part in ("result", "feedback"):  # which the client counts as connected before the server sends to it
        topic = f"{CONTROLLER}/follow_joint_trajectory/{part}"
        wait_until(lambda topic=topic: sends_to_us(topic), f"{topic} is connected")
    states.wait_for(1)
    return SimpleNamespace(ros=ros, states=states, client=client, process=process)


def begin_anew(robot: SimpleNamespace) -> None:
    """Resets the world of `open_world`, and has it run if it stands still."""
    answer = robot.ros.call("/rpbi/reset", Trigger)
    assert answer.success, answer.message
    robot.ros.call("/rpbi/start", Trigger)
    assert robot.client.wait_for_server(rospy.Duration(60.0))
    robot.states.wait_for_stamp(now(robot))
    robot.states.messages.clear()  # none from before the reset is under way any more
    robot.states.wait_for(1)


class Goal:
    """A goal that was sent, what has come back of it, and how to wait for its end."""

    def __init__(self, robot: SimpleNamespace, trajectory: JointTrajectory, **fields: Any) -> None:
        self.feedback: list[Any] = []
        self._done = threading.Event()
        goal = FollowJointTrajectoryGoal(trajectory=trajectory, **fields)
        self.handle = robot.client.send_goal(goal, self._on_transition, lambda _, fed: self.feedback.append(fed))

    def _on_transition(self, handle: Any) -> None:
        if handle.get_comm_state() == actionlib.CommState.DONE:
            self._done.set()

    def wait(self) -> tuple[int, int, str]:
        """Waits for the end; returns the status, the error code and the error string."""
        assert self._done.wait(60.0), "the goal was not answered"
        result = self.handle.get_result()
        return self.handle.get_terminal_state(), result.error_code, result.error_string

    def wait_until_accepted(self) -> None:
        wait_until(lambda: self.handle.get_goal_status() == GoalStatus.ACTIVE, "the goal is accepted")

    def wait_until_it_moves(self) -> None:
        wait_until(lambda: len(self.feedback) > 3, "the goal is being followed")


def trajectory(
    *points: tuple[float, list[float]], names: list[str] = JOINTS, velocity: bool = True, stamp: Any = None
) -> JointTrajectory:
    """Returns a trajectory through (time [s], positions [rad]); at rest at each of them unless told otherwise."""
    message = JointTrajectory(joint_names=names)
    for time_s, positions in points:
        point = JointTrajectoryPoint(positions=positions, time_from_start=rospy.Duration.from_sec(time_s))
        point.velocities = [0.0] * len(positions) if velocity else []
        message.points.append(point)
    if stamp is not None:
        message.header.stamp = stamp
    return message


def moved(by: float, joint: int = 0) -> list[float]:
    """Returns the start positions with one joint moved [rad]."""
    return [position + by * (index == joint) for index, position in enumerate(START)]


def far_away() -> JointTrajectory:
    """Returns a trajectory that takes longer than whatever a test does meanwhile."""
    return trajectory((10.0, moved(2.5)))


def tolerance(name: str, **limits: float) -> Any:
    return JointTolerance(name=name, **limits)


def now(robot: SimpleNamespace) -> rospy.Time:
    """Returns the stamp of the world; messages of later ones tell what has come of all before the call."""
    return robot.ros.call("/rpbi/get_state_hash", GetStateHash).stamp


def stands(messages: list[JointState]) -> bool:
    """Tells whether the robot does not move in any of some messages."""
    return all(abs(v) < 1e-3 for message in messages for v in message.velocity)


def wait_until_it_stands(robot: SimpleNamespace, count: int = 100) -> None:
    """Waits until the robot has not moved over so many messages [1 kHz], all from after the call."""
    called = now(robot)

    def has_stood() -> bool:
        last = robot.states.messages[-count:]
        return len(last) == count and last[0].header.stamp > called and stands(last)

    wait_until(has_stood, "the arm stands")
