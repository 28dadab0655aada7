"""The follower's topics and service, and what becomes of goals when the world around them changes."""

from __future__ import annotations

import subprocess

import pytest
import rospy
from actionlib_msgs.msg import GoalStatus
from control_msgs.msg import FollowJointTrajectoryActionFeedback, JointTrajectoryControllerState
from node_world import add, count, main_config, publishing, registrations, remove
from ros_system import stop_group, wait_until
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory
from trajectory_world import CONTROLLER, HOME, JOINTS, Goal, moved, trajectory
from worlds import iiwa, write_world

from ros_pybullet_interface.msg import PybulletObject
from rpbi.engine.pacer import MAX_DEBT_S


def test_client_with_simulated_time_is_served_in_it(start):
    robot = start(real_time_factor=3)
    arguments = [str(value) for value in (3.0, *moved(0.5))]
    client = robot.ros.start_program("trajectory_client.py", *arguments)
    assert client.wait(120.0) == 0, robot.ros.output(client)
    printed = robot.ros.output(client)
    assert f"state {GoalStatus.SUCCEEDED}, code 0, took " in printed
    assert float(printed.split()[-1]) > 2.9  # by the wall clock it is a second


def _feedback_of(robot):
    """Listens to the topic of the action's feedback: the client passes nothing on that the answer has overtaken."""
    return robot.ros.listen(f"{CONTROLLER}/follow_joint_trajectory/feedback", FollowJointTrajectoryActionFeedback)


def test_feedback_comes_at_its_simulated_rate_with_desired_positions(start):
    robot = start(controller={"action_monitor_rate": 10})
    fed = _feedback_of(robot)
    assert Goal(robot, trajectory((1.5, moved(0.6)))).wait()[0] == GoalStatus.SUCCEEDED
    feedback = [message.feedback for message in fed.wait_for(14)]
    stamps_ns = [message.header.stamp.to_nsec() for message in feedback]
    assert len(stamps_ns) in (14, 15, 16)
    assert {round((b - a) / 1e6) for a, b in zip(stamps_ns, stamps_ns[1:])} <= {99, 100, 101}
    for message in feedback:
        assert message.joint_names == JOINTS
        assert message.error.positions[0] == pytest.approx(
            message.desired.positions[0] - message.actual.positions[0], abs=1e-12
        )
        assert abs(message.error.positions[0]) < 2e-3
    assert feedback[7].desired.velocities[0] > 0.3  # the middle of a cubic from rest to rest


@pytest.mark.quick
def test_command_is_followed_and_states_come_at_their_rate(ros, tmp_path):
    robot = iiwa(joint_trajectory_controller={"state_publish_rate": 100}, **HOME)
    ros.simulator(main_config(tmp_path, robots=(robot,)), use_sim_time=True)
    states = ros.listen(f"{CONTROLLER}/state", JointTrajectoryControllerState)
    with publishing(f"{CONTROLLER}/command", JointTrajectory) as command:
        command.publish(trajectory((0.5, moved(0.3)), velocity=False))

        def end():
            message = states.messages[-1]
            return message.desired.positions[0] == pytest.approx(0.3, abs=1e-12) and message

        message = wait_until(end, "it has come to the end")
        wait_until(lambda: states.messages[-1].actual.positions[0] == pytest.approx(0.3, abs=1e-3), "the arm too")
    assert message.joint_names == JOINTS
    gaps_ns = {b - a for a, b in zip(states.stamps_ns, states.stamps_ns[1:])}
    assert gaps_ns == {10_000_000}


def test_check_lists_the_action(tmp_path):
    world = write_world(tmp_path, robots=(iiwa(joint_trajectory_controller={}),))
    done = subprocess.run(
        ["rosrun", "ros_pybullet_interface", "check_world.py", world], capture_output=True, text=True, check=True
    )
    assert "joint_trajectory_controller/follow_joint_trajectory" in done.stdout
    assert "control_msgs/QueryTrajectoryState" in done.stdout


def test_robot_without_the_key_has_none_of_it(ros, tmp_path):
    ros.simulator(main_config(tmp_path, robots=(iiwa(),)))
    assert not [name for _, name in registrations() if "joint_trajectory_controller" in name]


def test_removed_robot_answers_its_goal_and_leaves_nothing_behind(start):
    robot = start()
    goal = Goal(robot, trajectory((20.0, moved(1.2))))
    goal.wait_until_it_moves()
    assert remove(robot.ros, "iiwa").success
    status, code, text = goal.wait()
    assert (status, code) == (GoalStatus.ABORTED, -1)
    assert "removed" in text and "lbr_iiwa_joint_1=" in text
    wait_until(lambda: not [name for _, name in registrations() if "iiwa" in name], "nothing is left")


def test_robots_that_come_and_go_leave_no_threads_behind(start):
    robot = start()
    config = iiwa("second", joint_trajectory_controller={})

    def come_and_go() -> int:
        assert add(robot.ros, PybulletObject.ROBOT, config).success
        assert remove(robot.ros, "second").success
        return count(robot.process.pid, "task")

    first = come_and_go()
    last = [come_and_go() for _ in range(5)][-1]
    wait_until(lambda: count(robot.process.pid, "task") <= first + 2, f"of {last} threads about {first} stay")


def test_node_ending_during_a_goal_ends_cleanly(start):
    rospy.set_param("actionlib_status_frequency", 500.0)  # its topic closes between two messages
    robot = start()
    goal = Goal(robot, trajectory((20.0, moved(1.2))))
    goal.wait_until_it_moves()
    assert stop_group(robot.process) == 0
    status, _, text = goal.wait()
    assert status == GoalStatus.ABORTED and "the simulation ended" in text
    assert "Traceback" not in robot.ros.output(robot.process)


def test_goal_of_a_stopped_world_can_be_cancelled(start):
    robot = start(start_pybullet_after_initialization=False)
    goal = Goal(robot, trajectory((1.0, moved(0.3))))
    goal.wait_until_accepted()
    goal.handle.cancel()
    status, _, text = goal.wait()
    assert status == GoalStatus.PREEMPTED and "cancelled" in text


@pytest.mark.parametrize("use_sim_time", [True, False], ids=["sim time", "wall time"])
def test_goal_begins_at_its_stamp(start, use_sim_time):
    robot = start(use_sim_time=use_sim_time, start_pybullet_after_initialization=not use_sim_time)
    stamp = robot.states.messages[-1].header.stamp + rospy.Duration.from_sec(0.5 if use_sim_time else 2.0)
    Goal(robot, trajectory((10.0, moved(2.5)), stamp=stamp)).wait_until_accepted()
    if use_sim_time:
        assert robot.ros.call("/rpbi/start", Trigger).success  # only now, else the stamp may be of the past by then
    moving = wait_until(
        lambda: [each.header.stamp for each in list(robot.states.messages) if abs(each.velocity[0]) > 0.01], "it moves"
    )
    late_s = (moving[0] - stamp).to_sec()
    if use_sim_time:
        assert late_s == pytest.approx(0.07, abs=0.03)  # 0.15 rad/s^2 at the begin
    else:  # it waits in the world's time, which may fall behind the wall clock, or catch up with it
        assert late_s > -MAX_DEBT_S


@pytest.mark.parametrize("factor", [0, 0.3, 2])
def test_trajectory_takes_its_simulated_time_at_any_speed(start, factor):
    robot = start(real_time_factor=factor)
    fed = _feedback_of(robot)
    status, code, text = Goal(robot, trajectory((1.0, moved(0.5)))).wait()
    assert (status, code) == (GoalStatus.SUCCEEDED, 0), text
    feedback = [message.feedback for message in fed.wait_for(19)]  # at 20 Hz
    stamps_s = [message.header.stamp.to_sec() for message in feedback]
    since_start_s = [message.desired.time_from_start.to_sec() for message in feedback]
    for message, stamp_s, t in zip(feedback, stamps_s, since_start_s):
        assert stamp_s - stamps_s[0] == pytest.approx(t - since_start_s[0], abs=1e-6)
        cubic = 3 * t**2 - 2 * t**3  # from rest to rest in 1 s
        assert message.desired.positions[0] == pytest.approx(0.5 * cubic, abs=2e-3)
