"""The action of a follower of trajectories, driven by actionlib's own client from another process."""

from __future__ import annotations

import math
import os
from types import SimpleNamespace
from typing import Any

import pytest
import rospy
from actionlib_msgs.msg import GoalStatus
from ros_system import wait_until
from trajectory_world import JOINTS, START, Goal, moved, open_world, stands, tolerance, trajectory

from ros_pybullet_interface.msg import JointTrajectoryControllerState


@pytest.fixture(scope="module")
def refusing(module_ros: Any, control_msgs: str, tmp_path_factory: pytest.TempPathFactory) -> SimpleNamespace:
    """One world that all bad goals are sent to."""
    robot = open_world(module_ros, control_msgs, tmp_path_factory.mktemp("refusing"))
    wait_until(lambda: stands(robot.states), "the arm stands")
    return robot


def test_types_are_the_public_ones(control_msgs):
    """Else the tests would hold with each other, and no planner with the simulator."""
    from control_msgs.msg import FollowJointTrajectoryAction
    from control_msgs.msg import JointTrajectoryControllerState as PublicState

    assert FollowJointTrajectoryAction._md5sum == "bc4f9b743838566551c0390c65f1a248"
    assert PublicState._md5sum == JointTrajectoryControllerState._md5sum == "10817c60c2486ef6b33e97dcd87f4474"


def test_goal_is_reached_with_joints_in_any_order(start):
    robot = start()
    order = [3, 0, 1, 2, 6, 5, 4]
    goal_positions = [0.4, 0.2, -0.3, -0.9, 0.3, -0.4, 0.5]
    middle = [(a + b) / 2 for a, b in zip(START, goal_positions)]
    names = [JOINTS[i] for i in order]
    message = trajectory((1.0, [middle[i] for i in order]), (2.0, [goal_positions[i] for i in order]), names=names)
    goal = Goal(robot, message)
    status, code, text = goal.wait()
    assert (status, code) == (GoalStatus.SUCCEEDED, 0), text
    reached = dict(zip(robot.states.messages[-1].name, robot.states.messages[-1].position))
    assert [reached[name] for name in JOINTS] == pytest.approx(goal_positions, abs=1e-3)


def test_client_with_simulated_time_is_served_in_it(start, control_msgs):
    robot = start(real_time_factor=3)
    paths = f"{control_msgs}:{os.environ.get('PYTHONPATH', '')}"
    arguments = [str(value) for value in (3.0, *moved(0.5))]
    client = robot.ros.start_program("trajectory_client.py", *arguments, PYTHONPATH=paths)
    assert client.wait(60.0) == 0, robot.ros.output(client)
    printed = robot.ros.output(client)
    assert f"state {GoalStatus.SUCCEEDED}, code 0, took " in printed
    assert float(printed.split()[-1]) > 2.9  # by the wall clock it is a second


def test_feedback_comes_at_its_rate_of_simulated_time_and_tells_where_the_joints_are_to_be(start):
    robot = start(controller={"action_monitor_rate": 10})
    goal = Goal(robot, trajectory((1.5, moved(0.6))))
    assert goal.wait()[0] == GoalStatus.SUCCEEDED
    stamps_ns = [message.header.stamp.to_nsec() for message in goal.feedback]
    assert len(stamps_ns) in (14, 15, 16)
    assert {round((b - a) / 1e6) for a, b in zip(stamps_ns, stamps_ns[1:])} <= {99, 100, 101}
    for message in goal.feedback:
        assert message.joint_names == JOINTS
        assert message.error.positions[0] == pytest.approx(
            message.desired.positions[0] - message.actual.positions[0], abs=1e-12
        )
        assert abs(message.error.positions[0]) < 2e-3
    assert goal.feedback[7].desired.velocities[0] > 0.3  # the middle of a cubic from rest to rest


def test_new_goal_preempts_the_old_one_and_goes_on_without_a_jerk(start):
    robot = start()
    first = Goal(robot, trajectory((4.0, moved(1.2))))
    first.wait_until_it_moves()
    second = Goal(robot, trajectory((2.0, moved(-0.3))))
    status, _, text = first.wait()
    assert status == GoalStatus.PREEMPTED and "newer trajectory" in text
    status, code, text = second.wait()
    assert (status, code) == (GoalStatus.SUCCEEDED, 0), text
    velocity = [message.velocity[0] for message in robot.states.messages]
    assert max(abs(b - a) for a, b in zip(velocity, velocity[1:])) < 0.05
    assert robot.states.messages[-1].position[0] == pytest.approx(-0.3, abs=1e-3)


def test_cancelled_goal_makes_the_arm_hold(start):
    robot = start()
    goal = Goal(robot, trajectory((4.0, moved(1.2))))
    goal.wait_until_it_moves()
    goal.handle.cancel()
    status, _, text = goal.wait()
    assert status == GoalStatus.PREEMPTED and "cancelled" in text
    wait_until(lambda: stands(robot.states), "the arm stands")
    assert 0.0 < robot.states.messages[-1].position[0] < 1.0


def test_arm_stops_when_it_is_off_its_path_and_says_so(start):
    robot = start()
    goal = Goal(robot, trajectory((4.0, moved(1.2))), path_tolerance=[tolerance("lbr_iiwa_joint_1", position=1e-9)])
    status, code, text = goal.wait()
    assert (status, code) == (GoalStatus.ABORTED, -4)
    assert "'lbr_iiwa_joint_1'" in text and "stop and hold" in text
    wait_until(lambda: stands(robot.states), "the arm stands")
    assert robot.states.messages[-1].position[0] < 0.5


def test_goal_that_is_missed_for_its_time_is_aborted(start):
    robot = start()
    goal = Goal(
        robot,
        trajectory((0.5, moved(0.2))),
        goal_tolerance=[tolerance("lbr_iiwa_joint_2", position=1e-12)],
        goal_time_tolerance=rospy.Duration.from_sec(0.2),
    )
    status, code, text = goal.wait()
    assert (status, code) == (GoalStatus.ABORTED, -5)
    assert "'lbr_iiwa_joint_2'" in text and "0.201 s after the end" in text


@pytest.mark.parametrize(
    "message, code, text",
    [
        (trajectory((1.0, [0.0] * 7), names=[*JOINTS[:6], "elbow"]), -2, "unknown joint 'elbow'"),
        (trajectory((1.0, [0.0] * 6), names=JOINTS[:6]), -2, "missing: lbr_iiwa_joint_7"),
        (trajectory((1.0, moved(4.0, 1))), -1, "'lbr_iiwa_joint_2' must be within"),
        (trajectory((1.0, [0.0, 0.0, math.nan, 0.0, 0.0, 0.0, 0.0])), -1, "got nan for joint 'lbr_iiwa_joint_3'"),
        (trajectory((1.0, START), (1.0, START)), -1, "times must increase"),
        (trajectory((1.0, START[:5])), -1, "expected positions of 7 joints, got 5"),
        (trajectory((0.01, moved(1.0))), -1, "'lbr_iiwa_joint_1' would need"),
        (trajectory((0.0, START)), -1, "expected a point after the start"),
        (trajectory((0.01, START), stamp=rospy.Time(0, 1)), -3, "all points are in the past"),
    ],
    ids=["unknown", "missing", "limit", "nan", "times", "length", "speed", "no time", "old"],
)
def test_bad_goal_is_refused_before_anything_moves(refusing, message, code, text):
    goal = Goal(refusing, message)
    status, error_code, error_string = goal.wait()
    assert (status, error_code) == (GoalStatus.REJECTED, code)
    assert text in error_string
    assert goal.handle.get_goal_status_text() == error_string
    assert stands(refusing.states)
