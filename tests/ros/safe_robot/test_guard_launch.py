"""The launch files of the package."""

from __future__ import annotations

import os
import signal
from pathlib import Path
from xml.etree import ElementTree
from xmlrpc.client import ServerProxy

import pytest
import rosgraph
import rospy
from guarded_arm import HOME, KUKA
from nextage_like import nextage_like
from ros_system import wait_until
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from safe_robot.msg import Violation

PATIENT = ("silence_s:=60", "start_from:=target")


def drive(
    ros, names: list[str], start: list[float], goal: list[float], rise: float
) -> tuple[list[JointState], list[Violation]]:
    """Sends targets from a start towards a goal, each when the one before has been answered, until one is not safe.

    Steps become larger by `rise` [rad], up to fifty times it.
    """
    commands = ros.listen("/joint_states/command", JointState)
    violations = ros.listen("/robot_safety/violation", Violation)
    targets = rospy.Publisher("/joint_states/target", JointState, queue_size=10)
    wait_until(lambda: commands.is_connected and violations.is_connected, "the guard sends to the test")
    wait_until(targets.get_num_connections, "the guard listens to the test")
    q, pace = list(start), 0.0
    while not violations.messages and max(abs(a - b) for a, b in zip(q, goal)) > 1e-9:
        pace = min(pace + rise, 50.0 * rise)
        q = [a + max(-pace, min(pace, b - a)) for a, b in zip(q, goal)]
        sent = len(commands.messages)
        targets.publish(JointState(Header(stamp=rospy.Time.now()), names, q, [], []))
        wait_until(lambda: len(commands.messages) > sent or violations.messages, "a decision", every_s=0.0005)  # noqa: B023
    said = list(commands.messages), list(violations.messages)
    targets.unregister()  # after a target that moves the arm that is a violation, too
    return said


@pytest.mark.parametrize("folds_inwards", [False, True])
def test_nextage_launch_guards_both_arms_together(ros, tmp_path, folds_inwards):
    """Each arm may go where it goes, but not both: hands in front of the chest."""
    file, names = nextage_like(tmp_path)
    ros.start(
        [
            *("roslaunch", "safe_robot", "nextage.launch", f"robot_description:={file}", *PATIENT),
            "limits:={acceleration: 1000.0, jerk: 1000000.0}",
            "checks:={self_collision: {margin_m: 0.02}, staleness: {timeout_s: 60.0}}",
        ]
    )
    goal = dict.fromkeys(names, 0.0)
    for arm, inwards in (("L", -1.0), ("R", 1.0)):
        goal[f"{arm}ARM_JOINT1"] = -1.5
        goal[f"{arm}ARM_JOINT0"] = inwards * 0.6 if folds_inwards or arm == "L" else 0.0
    commands, violations = drive(ros, names, [0.0] * 15, list(goal.values()), 2e-4)
    assert len(commands) > 50 and commands[-1].name == names
    if folds_inwards:
        assert violations[0].check == "self_collision"
        assert "LARM" in violations[0].subject and "RARM" in violations[0].subject
    else:
        assert not violations and commands[-1].position == pytest.approx(list(goal.values()))


def test_kuka_lwr_launch_guards_the_arm_of_a_file(ros):
    ros.start(["roslaunch", "safe_robot", "kuka_lwr.launch", f"robot_description:={KUKA}", *PATIENT, "timeout_s:=60"])
    names = [f"lwr_arm_{i}_joint" for i in range(7)]
    commands, violations = drive(ros, names, list(HOME), [*HOME[:6], 0.01], 2e-5)
    assert not violations and commands[-1].position == pytest.approx([*HOME[:6], 0.01])


def test_a_killed_guard_ends_its_launch(ros):
    """The robot stays at the last command: a guard that started again would take targets that nobody has seen."""
    roslaunch = ros.start(["roslaunch", "safe_robot", "kuka_lwr.launch", f"robot_description:={KUKA}"])
    guard = wait_until(lambda: rosgraph.Master("/test").lookupNode("/robot_safety_node"), "the guard is there")
    os.kill(ServerProxy(guard).getPid("/test")[2], signal.SIGKILL)
    wait_until(lambda: roslaunch.poll() is not None, "the launch has ended")
    assert "REQUIRED process [robot_safety_node-1] has died" in ros.output(roslaunch)


def test_all_launch_files_require_their_guards():
    files = (Path(__file__).resolve().parents[3] / "src").rglob("*.launch")
    nodes = [node for file in files for node in ElementTree.parse(file).iter("node")]
    required = [node.get("required") for node in nodes if node.get("type") == "safe_robot_node.py"]
    assert required == ["true"] * 4
