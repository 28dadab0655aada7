"""Goals, commands and targets for a robot that follows trajectories, all in one world that is reset between them."""

from __future__ import annotations

import math

import pytest
import rospy
from actionlib_msgs.msg import GoalStatus, GoalStatusArray
from cob_srvs.srv import SetString
from control_msgs.msg import FollowJointTrajectoryAction, JointTrajectoryControllerState
from control_msgs.srv import QueryTrajectoryState
from node_world import Rosout, publishing
from ros_system import wait_until
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory
from trajectory_world import (
    CONTROLLER,
    JOINTS,
    START,
    Goal,
    far_away,
    moved,
    now,
    stands,
    tolerance,
    trajectory,
    wait_until_it_stands,
)

from ros_pybullet_interface.srv import StepN


def test_types_are_the_public_ones():
    """Else the tests would hold with each other, and no planner with the simulator."""
    assert FollowJointTrajectoryAction._md5sum == "bc4f9b743838566551c0390c65f1a248"
    assert JointTrajectoryControllerState._md5sum == "10817c60c2486ef6b33e97dcd87f4474"


def test_goal_is_reached_with_joints_in_any_order(robot):
    order = [3, 0, 1, 2, 6, 5, 4]
    goal_positions = [0.4, 0.2, -0.3, -0.9, 0.3, -0.4, 0.5]
    middle = [(a + b) / 2 for a, b in zip(START, goal_positions)]
    names = [JOINTS[i] for i in order]
    message = trajectory((1.0, [middle[i] for i in order]), (2.0, [goal_positions[i] for i in order]), names=names)
    goal = Goal(robot, message)
    status, code, text = goal.wait()
    assert (status, code) == (GoalStatus.SUCCEEDED, 0), text

    def reached():
        position = dict(zip(robot.states.messages[-1].name, robot.states.messages[-1].position))
        return [position[name] for name in JOINTS] == pytest.approx(goal_positions, abs=1e-3)

    wait_until(reached, "joint states tell that it is there")


def test_new_goal_preempts_the_old_one_and_continues_smoothly(robot):
    first = Goal(robot, far_away())
    wait_until(lambda: robot.states.messages[-1].velocity[0] > 0.08, "a jerk would be seen")
    second = Goal(robot, trajectory((2.0, moved(-0.3))))
    status, _, text = first.wait()
    assert status == GoalStatus.PREEMPTED and "newer trajectory" in text
    status, code, text = second.wait()
    assert (status, code) == (GoalStatus.SUCCEEDED, 0), text
    wait_until(lambda: robot.states.messages[-1].position[0] == pytest.approx(-0.3, abs=1e-3), "it is there")
    velocity = [message.velocity[0] for message in robot.states.messages]
    assert max(abs(b - a) for a, b in zip(velocity, velocity[1:])) < 0.05


def test_cancelled_goal_makes_the_arm_hold(robot):
    goal = Goal(robot, far_away())
    goal.wait_until_it_moves()
    goal.handle.cancel()
    status, _, text = goal.wait()
    assert status == GoalStatus.PREEMPTED and "cancelled" in text
    wait_until_it_stands(robot)
    assert 0.0 < robot.states.messages[-1].position[0] < 2.0


def test_arm_off_its_path_stops_and_reports_it(robot):
    goal = Goal(robot, trajectory((4.0, moved(1.2))), path_tolerance=[tolerance("lbr_iiwa_joint_1", position=1e-9)])
    status, code, text = goal.wait()
    assert (status, code) == (GoalStatus.ABORTED, -4)
    assert "'lbr_iiwa_joint_1'" in text and "stop and hold" in text
    wait_until_it_stands(robot)
    assert robot.states.messages[-1].position[0] < 0.5


def test_goal_that_is_missed_for_its_time_is_aborted(robot):
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
def test_bad_goal_is_refused_before_anything_moves(robot, message, code, text):
    wait_until_it_stands(robot)
    begin = len(robot.states.messages)
    goal = Goal(robot, message)
    status, error_code, error_string = goal.wait()
    assert (status, error_code) == (GoalStatus.REJECTED, code)
    assert text in error_string
    assert goal.handle.get_goal_status_text() == error_string
    robot.states.wait_for_stamp(now(robot))
    assert stands(robot.states.messages[begin:])


def test_command_replaces_a_goal_and_an_empty_one_holds_position(robot):
    goal = Goal(robot, far_away())
    goal.wait_until_it_moves()
    with publishing(f"{CONTROLLER}/command", JointTrajectory) as command:
        command.publish(trajectory((10.0, moved(-2.5))))
        status, _, text = goal.wait()
        assert status == GoalStatus.PREEMPTED and "newer trajectory" in text
        wait_until(lambda: robot.states.messages[-1].velocity[0] < -0.05, "it moves back")
        command.publish(JointTrajectory())
        wait_until_it_stands(robot)
    assert -2.0 < robot.states.messages[-1].position[0]


def _goal_that_waits(robot, message):
    """Returns a goal of a world that stands still until the test starts it, so that nothing comes after its end."""
    assert robot.ros.call("/rpbi/stop", Trigger).success
    goal = Goal(robot, message)
    goal.wait_until_accepted()
    return goal


def test_bad_command_is_named_and_changes_nothing(robot):
    log = Rosout(robot.ros)
    goal = _goal_that_waits(robot, trajectory((1.5, moved(0.5))))
    with publishing(f"{CONTROLLER}/command", JointTrajectory) as command:
        command.publish(trajectory((1.0, moved(9.0))))
        log.wait_for([f"{CONTROLLER}/command", "'lbr_iiwa_joint_1' must be within"])
    assert robot.ros.call("/rpbi/start", Trigger).success
    assert goal.wait()[0] == GoalStatus.SUCCEEDED


def test_targets_of_joints_in_trajectories_are_refused_until_the_end(robot):
    log = Rosout(robot.ros)
    goal = _goal_that_waits(robot, trajectory((1.5, moved(0.5))))
    with publishing("/rpbi/iiwa/joint_states/target", JointState) as target:
        target.publish(JointState(name=["lbr_iiwa_joint_1"], position=[-1.0]))
        log.wait_for(["a motion drives lbr_iiwa_joint_1"])
        assert robot.ros.call("/rpbi/start", Trigger).success
        assert goal.wait()[0] == GoalStatus.SUCCEEDED
        target.publish(JointState(name=["lbr_iiwa_joint_1"], position=[-0.2]))
        wait_until(lambda: robot.states.messages[-1].position[0] < -0.19, "it follows targets again")


def test_each_of_many_goals_has_its_answer(robot):
    # The last one alone is short: no other may arrive before the next one comes
    durations_s = [20.0] * 59 + [0.5]
    goals = [Goal(robot, trajectory((time_s, moved(0.01 * n)))) for n, time_s in enumerate(durations_s)]
    *others, last = [goal.wait()[0] for goal in goals]
    assert last == GoalStatus.SUCCEEDED
    assert set(others) == {GoalStatus.PREEMPTED}


def test_stopped_world_freezes_the_goal(robot):
    goal = Goal(robot, trajectory((5.0, moved(2.0))))
    goal.wait_until_it_moves()
    assert robot.ros.call("/rpbi/stop", Trigger).success
    stopped = robot.ros.call("/rpbi/step_n", StepN, 0).stamp
    frozen = robot.states.wait_for_stamp(stopped).position[0]
    steps = [robot.ros.call("/rpbi/step", Trigger).success for _ in range(20)]
    assert all(steps)
    wait_until(lambda: robot.states.messages[-1].position[0] > frozen, "it moves by steps")
    assert robot.states.messages[-1].position[0] < frozen + 0.03
    assert sum(message.header.stamp > stopped for message in goal.feedback) <= 2
    assert goal.handle.get_goal_status() == GoalStatus.ACTIVE
    assert robot.ros.call("/rpbi/step_n", StepN, 4000).success  # sooner done than by the wall clock
    assert robot.ros.call("/rpbi/start", Trigger).success
    status, code, text = goal.wait()
    assert (status, code) == (GoalStatus.SUCCEEDED, 0), text


def test_status_and_results_have_the_stamps_of_the_world(robot):
    statuses = robot.ros.listen(f"{CONTROLLER}/follow_joint_trajectory/status", GoalStatusArray)
    for message in list(statuses.wait_for(3)):
        assert message.header.stamp.to_sec() < 1e6, "a wall stamp"


def test_query_returns_the_future_joint_state(robot):
    stamp = robot.states.messages[-1].header.stamp + rospy.Duration.from_sec(60.0)
    Goal(robot, trajectory((2.0, moved(0.8)), stamp=stamp)).wait_until_accepted()
    answer = robot.ros.call(f"{CONTROLLER}/query_state", QueryTrajectoryState, stamp + rospy.Duration.from_sec(1.0))
    assert list(answer.name) == JOINTS
    assert answer.position[0] == pytest.approx(0.4, abs=2e-3)  # the middle of a cubic from rest to rest
    assert answer.velocity[0] == pytest.approx(0.6, abs=2e-3)  # 3/2 of the mean
    assert list(answer.position[1:]) == pytest.approx(START[1:], abs=1e-3)


def test_goal_is_refused_under_torque_control(robot):
    assert robot.ros.call("/rpbi/iiwa/set_control_mode", SetString, "TORQUE_CONTROL").success
    status, code, text = Goal(robot, trajectory((1.0, moved(0.3)))).wait()
    assert (status, code) == (GoalStatus.REJECTED, -1)
    assert "TORQUE_CONTROL" in text


def test_changing_the_control_mode_aborts_the_goal(robot):
    goal = Goal(robot, far_away())
    goal.wait_until_it_moves()
    assert robot.ros.call("/rpbi/iiwa/set_control_mode", SetString, "VELOCITY_CONTROL").success
    status, code, text = goal.wait()
    assert (status, code) == (GoalStatus.ABORTED, -1) and "control mode was changed" in text
    assert Goal(robot, trajectory((0.5, moved(0.2)))).wait()[0] == GoalStatus.SUCCEEDED
