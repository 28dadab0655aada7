"""The examples of robots do what they say, headless."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import rosgraph
import rosnode
import rospy
import tf2_ros
from cob_srvs.srv import SetString
from geometry_msgs.msg import WrenchStamped
from node_world import publishing
from real_robot import RealRobot
from ros_system import wait_until
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from ros_pybullet_interface.msg import Contacts, ControllerState
from ros_pybullet_interface.srv import ResetJointState, SwitchControllers
from rpbi_examples.motions import CIRCLE_CENTRE, CIRCLE_RADIUS
from safe_robot.msg import Status, Violation

ROOT = Path(__file__).resolve().parents[3]


def launch(ros, example: str, **arguments: object) -> None:
    """Starts an example without windows and waits until its world runs."""
    given = [f"{key}:={value}" for key, value in arguments.items()]
    process = ros.start(["roslaunch", "rpbi_examples", f"{example}.launch", "headless:=true", *given])
    wait_until(lambda: process.poll() is not None or _serves("/rpbi/list_objects"), f"{example} is up")
    assert process.poll() is None, ros.output(process)


def _serves(name: str) -> bool:
    try:
        rosgraph.Master("/tests").lookupService(name)
        return True
    except rosgraph.MasterError:
        return False


@pytest.fixture
def position(ros) -> Callable[[str], tuple[float, float, float] | None]:
    """Tells where a frame is in the world [m]."""
    buffer = ros.listen_to_tf()

    def look(frame: str, with_frame: str | None = None) -> tuple[float, float, float] | None:
        """Returns where it is now, or was when the other frame was last heard of as well."""
        try:
            time = buffer.get_latest_common_time(frame, with_frame) if with_frame else rospy.Time(0)
            found = buffer.lookup_transform("rpbi/world", frame, time).transform.translation
        except tf2_ros.TransformException:
            return None
        return found.x, found.y, found.z

    return look


@pytest.mark.thorough
def test_two_guarded_hands_draw_mirrored_circles(ros, position):
    statuses = ros.listen("/robot_safety/status", Status)
    launch(ros, "basic_example_dual_iiwa", real_time_factor=2)
    hands = {1.0: "rpbi/left/lbr_iiwa_link_7", -1.0: "rpbi/right/lbr_iiwa_link_7"}
    x, y, z = CIRCLE_CENTRE

    def off(side: float) -> tuple[float, float] | None:
        """Returns how far a hand is from its circle, and where on it [m, rad]."""
        found = position(hands[side], with_frame=hands[-side])
        if found is None:
            return None
        dy, dz = side * found[1] - y, found[2] - z - CIRCLE_RADIUS
        return math.hypot(math.hypot(dy, dz) - CIRCLE_RADIUS, found[0] - x), math.atan2(dy, -dz)

    angles = set()
    both: list[float] = []

    def drawn() -> bool:
        left, right = off(1.0), off(-1.0)
        if left is None or right is None or max(left[0], right[0]) > 0.01:
            return False
        both.append(abs(math.remainder(left[1] - right[1], math.tau)))
        angles.add(int(left[1] // (math.pi / 4)))
        return len(angles) == 8

    wait_until(drawn, "the hands went round, within 1 cm of their circles")
    assert sorted(both)[len(both) // 2] < 0.1, "both are at the same place of their circle most of the time"
    safe = [each.is_safe for each in list(statuses.messages)]
    assert sum(safe) > 0.9 * len(safe), "circles pass"

    rosnode.kill_nodes(["/dual_arm_example"])
    wait_until(lambda: ros.call("/robot_safety/start_subscriber", Trigger).success, "the arms rest", every_s=0.2)
    violations = ros.listen("/robot_safety/violation", Violation)
    ros.start(["rosrun", "rpbi_examples", "dual_arm_example_node.py", "left", "right", "_distance:=0.3"])

    def met() -> bool:
        """Tells whether the guard kept a link of the left arm and one of the right from coming nearer."""
        found = [each.subject for each in list(violations.messages) if each.check == "self_collision"]
        return any("left_" in each and "right_" in each for each in found)

    wait_until(met, "targets that cross the arms are not safe")


@pytest.mark.alone
@pytest.mark.thorough
def test_panda_works_with_ros_tools_and_leads_a_real_one(ros, position):
    real = RealRobot(ros)
    launch(ros, "basic_example_panda", move="false", real_robot="true")
    wait_until(lambda: position("rpbi/panda/panda_hand"), "robot_state_publisher tells where the hand is")
    wrenches = ros.listen("/rpbi/panda/panda_joint8/ft_sensor", WrenchStamped)
    weight = 9.81 * (0.81 + 2 * 0.1)  # hand and fingers in PyBullet's URDF

    def carries_the_hand() -> bool:
        forces = [each.wrench.force for each in wrenches.wait_for(20)[-20:]]
        return all(math.hypot(force.x, force.y, force.z) == pytest.approx(weight, rel=0.02) for force in forces)

    wait_until(carries_the_hand, "the wrist carries the weight of the hand, and goes on so")

    states = ros.listen("/rpbi/panda/joint_states", JointState)
    start = dict(zip(states.wait_for(1)[-1].name, states.messages[-1].position))
    trajectory = JointTrajectory(joint_names=[f"panda_joint{i}" for i in range(1, 8)])
    goal = [0.4, *[start[name] for name in trajectory.joint_names[1:]]]
    trajectory.points = [JointTrajectoryPoint(positions=goal, time_from_start=rospy.Duration(1.0))]
    with publishing("/rpbi/panda/joint_trajectory_controller/command", JointTrajectory) as command:
        command.publish(trajectory)
        wait_until(
            lambda: abs(dict(zip(states.messages[-1].name, states.messages[-1].position))["panda_joint1"] - 0.4) < 0.01,
            "it follows a trajectory",
        )
        real.wait_until_moved()


@pytest.mark.thorough
@pytest.mark.parametrize("robot", ["kinova", "talos", "nextage", "human"])
def test_joints_of_a_robot_swing_in_turn(ros, robot):
    launch(ros, f"basic_example_{'human_model' if robot == 'human' else robot}", real_time_factor=4)
    states = ros.listen(f"/rpbi/{robot}/joint_states", JointState)
    states.wait_for(1)

    def swung() -> list[int]:
        """Returns the joints that have swung to one side, in the order in which they did."""
        positions = np.array([each.position for each in list(states.messages)])
        away = np.abs(positions - positions[0]) > 0.25
        return sorted(np.flatnonzero(away.any(axis=0)).tolist(), key=lambda joint: int(away[:, joint].argmax()))

    wait_until(lambda: len(swung()) >= 2, "two joints have swung", every_s=0.5)
    assert swung()[:2] == sorted(swung()[:2]), "one after the other"


@pytest.mark.quick
def test_kuka_is_at_rest_until_commanded(ros):
    launch(ros, "run_kuka")
    states = ros.listen("/rpbi/kuka_lwr/joint_states", JointState)
    home = states.wait_for(200)[0].position
    assert states.messages[-1].position == pytest.approx(home, abs=2e-3)
    goal = JointState(name=["lwr_arm_0_joint"], position=[0.5])
    answer = ros.call("/rpbi/kuka_lwr/move_to_joint_state", ResetJointState, goal, 0.5)
    assert answer.success, answer.message


def test_still_scene_keeps_the_tool_at_the_whiteboard(ros, position):
    launch(ros, "run_pose_kuka_lwr")
    states = ros.listen("/rpbi/kuka_lwr/joint_states", JointState)
    start = states.wait_for(1)[0].position
    ball, cup = "rpbi/kuka_lwr/end_effector_ball", "rpbi/cup/base_link"
    wait_until(lambda: position(ball) and position(cup), "their frames are on TF")
    states.wait_for(200)
    assert states.messages[-1].position == pytest.approx(start, abs=2e-3)
    board_x, ball_radius = -0.187, 0.015
    assert position(ball)[0] - board_x == pytest.approx(ball_radius, abs=5e-3)
    assert position(cup) == pytest.approx((0.05, 0.70, 0.501), abs=2e-3)


def test_twin_shows_the_arms_motion_a_metre_to_the_side(ros, position):
    launch(ros, "visual_robot")
    arm, twin = "rpbi/kuka_lwr/lwr_arm_7_link", "rpbi/twin/lwr_arm_7_link"
    start = wait_until(lambda: position(arm) and position(twin), "their frames are on TF")

    def shows_it():
        here, there = position(arm), position(twin)
        return math.dist(there, start) > 0.05 and math.dist((here[0], here[1] + 1.0, here[2]), there) < 0.05

    wait_until(shows_it, "the twin moves as the arm does")


@pytest.mark.thorough
def test_it_wipes_a_table_with_the_force_asked_for(ros):
    states = ros.listen("/rpbi/kuka_lwr/wipe/state", ControllerState)
    contacts = ros.listen("/rpbi/kuka_lwr/contacts", Contacts)
    launch(ros, "wiping_example", real_time_factor=2)

    def force(message: Contacts) -> float:
        return sum(point.normal_force for point in message.points if point.other_body == "table")

    def wipes() -> bool:
        last = dict(zip(states.messages[-1].value_names, states.messages[-1].values)) if states.messages else {}
        return abs(last.get("force/y", 0.0)) > 4.0

    wait_until(wipes, "it moves against the friction of the table")
    begin = len(contacts.messages)
    contacts.wait_for(begin + 100)
    forces = [force(message) for message in contacts.messages[begin:]]
    assert math.sqrt(sum((each - 20.0) ** 2 for each in forces) / len(forces)) < 1.0
    assert max(map(force, contacts.messages)) < 25.0
    switch = rospy.ServiceProxy("/rpbi/kuka_lwr/switch_controllers", SwitchControllers)
    assert switch(stop=["wipe"]).success
    refused = switch(start=["wash"])
    assert not refused.success and "wash" in refused.message
    softer = rospy.ServiceProxy("/rpbi/kuka_lwr/wipe/set_gains", SetString)
    assert not softer("{force: -1}").success
    assert softer("{force: 5}").success and switch(start=["wipe"]).success
    wait_until(lambda: abs(force(contacts.messages[-1]) - 5.0) < 0.5, "it presses with 5 N")
