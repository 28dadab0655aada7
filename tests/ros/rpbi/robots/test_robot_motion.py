"""Motions, modes and teleports of a robot over ROS."""

from __future__ import annotations

import math
import re
import threading

import pytest
import rospy
from cob_srvs.srv import SetString
from custom_srvs.srv import SetTransform
from node_world import Rosout, add, main_config, publishing, remove
from ros_system import wait_until
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from worlds import box, iiwa

from ros_pybullet_interface.msg import CalculateInverseKinematicsProblem, PybulletObject
from ros_pybullet_interface.srv import CalculateInverseKinematics, ResetEffState, ResetJointState, SetJointState

FIRST, FOURTH = "lbr_iiwa_joint_1", "lbr_iiwa_joint_4"
JOINTS = [f"lbr_iiwa_joint_{i}" for i in range(1, 8)]
FAR, LONG_S, UNDER_WAY = 2.5, 20.0, 0.01
"""A goal of the first joint [rad], a duration that outlasts whatever a test does meanwhile, where it is soon [rad]."""
BENT = dict(zip(JOINTS, [0.0, 30.0, 0.0, -60.0, 0.0, 40.0, 0.0]))


@pytest.fixture(scope="module")
def node(module_ros, tmp_path_factory):
    module_ros.simulator(
        main_config(
            tmp_path_factory.mktemp("world"),
            robots=(iiwa("iiwa", initial_joint_position=BENT, joint_state_publisher_hz=100.0),),
            dynamic=(box("box", basePosition=[2.0, 0.0, 0.1]),),
            timeStep=0.005,
        )
    )
    return module_ros


@pytest.fixture
def states(node, ros):
    """Joint states of a robot in position control at its start, running."""
    listener = ros.listen("/rpbi/iiwa/joint_states", JointState)
    listener.wait_for(1)
    yield listener
    ros.call("/rpbi/start", Trigger)
    ros.call("/rpbi/iiwa/set_control_mode", SetString, "POSITION_CONTROL")
    start = JointState(name=list(BENT), position=[math.radians(q) for q in BENT.values()])
    assert ros.call("/rpbi/iiwa/set_joint_state", SetJointState, start).success


def move(ros, duration_s, **goal):
    state = JointState(name=[f"lbr_iiwa_joint_{key[1]}" for key in goal], position=list(goal.values()))
    return ros.call("/rpbi/iiwa/move_to_joint_state", ResetJointState, state, duration_s)


def in_background(call):
    """Makes a call in a thread; returns a function that waits for its answer."""
    answers = []
    thread = threading.Thread(target=lambda: answers.append(call()))
    thread.start()

    def wait():
        thread.join(60.0)
        return answers[0]

    return wait


def now(states) -> dict[str, float]:
    """Returns where the joints are, by a message that was made after the call."""
    message = states.wait_for_stamp(rospy.Time.now())
    return dict(zip(message.name, message.position))


def wait_until_under_way(states):
    wait_until(lambda: now(states)[FIRST] > UNDER_WAY, "the move is under way")


@pytest.mark.quick
def test_robot_moves_to_a_joint_state_before_the_answer(ros, states):
    answer = move(ros, 0.5, j1=0.4, j4=-1.2)
    assert answer.success, answer.message
    assert (now(states)[FIRST], now(states)[FOURTH]) == pytest.approx((0.4, -1.2), abs=0.01)
    assert now(states)[JOINTS[1]] == pytest.approx(math.radians(30.0), abs=0.005), "joints not named stay"


@pytest.mark.parametrize("service", ["move_to_initial_joint_state", "move_to_init_joint_state"])
def test_robot_returns_to_its_start_whatever_the_request_contains(ros, states, service):
    move(ros, 0.3, j1=0.4)
    answer = ros.call(f"/rpbi/iiwa/{service}", ResetJointState, JointState(name=["no joint"]), 0.3)
    assert answer.success, answer.message
    assert [now(states)[name] for name in JOINTS] == pytest.approx(
        [math.radians(BENT[name]) for name in JOINTS], abs=0.01
    )


def test_its_hand_moves_to_a_pose(ros, states):
    here = ros.call(
        "/rpbi/iiwa/ik",
        CalculateInverseKinematics,
        CalculateInverseKinematicsProblem(link_name="lbr_iiwa_link_7", targetPosition=[0.5, 0.2, 0.6]),
    )
    assert here.success, here.message
    problem = CalculateInverseKinematicsProblem(link_name="lbr_iiwa_link_7", targetPosition=[0.5, 0.2, 0.6])
    answer = ros.call("/rpbi/iiwa/move_to_eff_state", ResetEffState, problem, 0.5)
    assert answer.success, answer.message
    assert "link 'lbr_iiwa_link_7' is " in answer.message
    assert float(answer.message.split("link 'lbr_iiwa_link_7' is ")[1].split(" mm")[0]) < 2.0
    assert [now(states)[name] for name in here.solution.name] == pytest.approx(list(here.solution.position), abs=0.02)


def test_a_pose_out_of_reach_moves_nothing(ros, states):
    before = now(states)
    problem = CalculateInverseKinematicsProblem(link_name="lbr_iiwa_link_7", targetPosition=[3.0, 0.0, 0.5])
    answer = ros.call("/rpbi/iiwa/move_to_eff_state", ResetEffState, problem, 0.5)
    assert not answer.success
    assert "nothing moved" in answer.message
    assert now(states) == pytest.approx(before, abs=1e-3)


def test_robot_stops_at_an_exceeded_limit_and_reports_it(ros, states):
    answer = move(ros, 0.3, j1=0.2, j4=-3.0)
    assert not answer.success
    assert f"went to the limits only: joint '{FOURTH}' must be within -2.0944 to 2.0944 rad, got -3;" in answer.message
    assert (now(states)[FIRST], now(states)[FOURTH]) == pytest.approx((0.2, -2.0944), abs=0.01)


REFUSED = {
    "not finite": ({"j1": math.nan}, 1.0, f"values must be finite, got nan for joint '{FIRST}'"),
    "unknown joint": ({"j9": 0.1}, 1.0, "unknown joint 'lbr_iiwa_joint_9': known are"),
    "duration": ({"j1": 0.2}, -1.0, "duration must be 0 to 1e+06 [s], got -1"),
    "no joint": ({}, 1.0, "expected a position for one joint or more, got none"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_goal_that_cannot_be_is_refused_before_anything_moves(ros, states, case):
    goal, duration_s, message = REFUSED[case]
    before = now(states)
    answer = move(ros, duration_s, **goal)
    assert not answer.success
    assert message in answer.message
    assert now(states) == pytest.approx(before, abs=1e-3)


def test_newer_of_two_moves_wins_and_the_older_reports_position(ros, states):
    first = in_background(lambda: move(ros, LONG_S, j1=FAR))
    wait_until_under_way(states)
    assert move(ros, 0.5, j1=-0.2).success
    answer = first()
    assert not answer.success
    assert "a newer motion replaced it before the goal" in answer.message
    assert UNDER_WAY < float(re.search(rf"{FIRST}=(\S+)", answer.message)[1]) < FAR


def test_stop_ends_a_move_and_stopped_robots_refuse_moves(ros, states):
    moving = in_background(lambda: move(ros, LONG_S, j1=FAR))
    wait_until_under_way(states)
    assert ros.call("/rpbi/stop", Trigger).success
    answer = moving()
    assert not answer.success
    assert "the simulation was stopped before the goal" in answer.message
    refused = move(ros, 1.0, j1=0.5)
    assert not refused.success
    assert refused.message == "nothing moved: the simulation is stopped; call rpbi/start first"
    reached = now(states)[FIRST]
    assert ros.call("/rpbi/start", Trigger).success
    states.wait_for(len(states.messages) + 15)
    assert now(states)[FIRST] == pytest.approx(reached, abs=0.02), "it does not go on by itself"


def test_removal_in_the_middle_is_answered(ros, node):
    load = {"fileName": "kuka_iiwa/model.urdf", "useFixedBase": True, "basePosition": [0.0, 3.0, 0.0]}
    assert add(ros, PybulletObject.ROBOT, iiwa("guest", loadURDF=load)).success
    states = ros.listen("/rpbi/guest/joint_states", JointState)
    goal = JointState(name=[FIRST], position=[FAR])
    moving = in_background(lambda: ros.call("/rpbi/guest/move_to_joint_state", ResetJointState, goal, LONG_S))
    wait_until_under_way(states)
    assert remove(ros, "guest").success
    answer = moving()
    assert not answer.success
    assert "the robot was removed before the goal" in answer.message


def test_modes_are_switched_and_targets_for_another_mode_named_once(ros, states):
    rosout = Rosout(ros)
    assert ros.call("/rpbi/iiwa/set_control_mode", SetString, "VELOCITY_CONTROL").success
    with publishing("/rpbi/iiwa/joint_states/target", JointState) as target:
        for _ in range(40):
            target.publish(JointState(name=[FIRST], position=[0.1]))
        rosout.wait_for(["expected velocity"])

        def goes():
            target.publish(JointState(name=[FIRST], velocity=[0.3]))
            return states.messages[-1].velocity[0] == pytest.approx(0.3, abs=0.05)

        wait_until(goes, "it has the velocity that is asked for")
    wait_until(lambda: abs(states.messages[-1].velocity[0]) < 1e-3, "it stops when nobody sends any more")
    assert len(rosout.logs("expected velocity")) == 1


def test_torque_control_lets_an_arm_fall_and_refuses_moves(ros, states):
    before = now(states)[JOINTS[1]]
    assert ros.call("/rpbi/iiwa/set_control_mode", SetString, "TORQUE_CONTROL").success
    assert "TORQUE_CONTROL" in move(ros, 1.0, j1=0.5).message
    wait_until(lambda: abs(now(states)[JOINTS[1]] - before) > 0.05, "it falls")


def test_an_empty_mode_asks_for_the_present_one(ros, node):
    answer = ros.call("/rpbi/iiwa/set_control_mode", SetString, "")
    assert (answer.success, answer.message) == (True, "POSITION_CONTROL")


@pytest.mark.parametrize("text", ["POSITION", "position_control"])
def test_an_unknown_mode_is_refused_with_those_there_are(ros, node, text):
    answer = ros.call("/rpbi/iiwa/set_control_mode", SetString, text)
    assert not answer.success
    assert "unknown control mode" in answer.message


def test_joints_are_put_somewhere_at_once(ros, states):
    answer = ros.call("/rpbi/iiwa/set_joint_state", SetJointState, JointState(name=[FIRST], position=[1.2]))
    assert answer.success, answer.message
    assert now(states)[FIRST] == pytest.approx(1.2, abs=0.01)
    refused = ros.call("/rpbi/iiwa/set_joint_state", SetJointState, JointState(name=[FIRST], position=[9.0]))
    assert not refused.success
    assert "must be within" in refused.message


def test_bodies_are_put_somewhere_at_once_and_nonsense_is_refused(ros, node):
    transform = SetTransform._request_class().transform
    transform.translation.x, transform.translation.z, transform.rotation.w = 2.5, 0.5, 1.0
    assert ros.call("/rpbi/box/set_pose", SetTransform, transform).success
    transform.translation.x = math.nan
    answer = ros.call("/rpbi/box/set_pose", SetTransform, transform)
    assert not answer.success
    assert "must be finite" in answer.message


def test_motion_is_stopped_by_service_which_otherwise_reports_no_motion(ros, states):
    moving = in_background(lambda: move(ros, LONG_S, j1=FAR))
    wait_until_under_way(states)
    assert ros.call("/rpbi/iiwa/stop_motion", Trigger).success
    assert "it was stopped before the goal" in moving().message
    answer = ros.call("/rpbi/iiwa/stop_motion", Trigger)
    assert not answer.success
    assert answer.message == "no motion is running"


def test_a_base_that_is_put_elsewhere_ends_the_motion(ros, states):
    moving = in_background(lambda: move(ros, LONG_S, j1=FAR))
    wait_until_under_way(states)
    transform = SetTransform._request_class().transform
    transform.rotation.w = 1.0
    assert ros.call("/rpbi/iiwa/set_pose", SetTransform, transform).success
    assert "the robot was moved to another pose before the goal" in moving().message
