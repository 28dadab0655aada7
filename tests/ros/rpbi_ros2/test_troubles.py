"""Bridges and programs that end and return, and what others do wrong."""

from __future__ import annotations

import contextlib
import os
import signal

import pytest
from control_msgs.msg import JointTrajectoryControllerState
from geometry_msgs.msg import Twist
from ros2_system import STATE, connect
from ros_system import RosSystem, wait_until
from sensor_msgs.msg import JointState

RECONNECTED_S = 5.0


def kill(ros: RosSystem, process) -> None:
    """Kills a program at once."""
    ros.processes.remove(process)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()


@pytest.mark.thorough
def test_both_sides_connect_again_after_they_were_killed(ros, ros2, publisher):
    out, heard = publisher("/arm/joint_states", JointState), ros.listen("/arm/target", JointState)
    bridge, peer = ros2.bridge(), ros2.peer()
    peer.listen("/arm/joint_states", STATE)
    peer.write("/arm/target", STATE)
    connect(peer, "/arm/joint_states", out, JointState())
    wait_until(lambda: peer.readers("/arm/target"), "the bridge reads")
    kill(ros, bridge)
    before = peer.count("/arm/joint_states")
    ros2.bridge()

    def both_work() -> bool:
        out.publish(JointState())
        peer.publish("/arm/target", {})
        return peer.count("/arm/joint_states") > before and bool(heard.messages)

    wait_until(both_work, "the new bridge carries", RECONNECTED_S)
    kill(ros, peer.process)
    peer = ros2.peer()
    peer.listen("/arm/joint_states", STATE)
    connect(peer, "/arm/joint_states", out, JointState())


def test_second_bridge_in_a_domain_ends_with_one_line(ros, ros2, publisher):
    out = publisher("/arm/joint_states", JointState)
    first = ros2.bridge()
    second = ros2.bridge("__name:=second")
    assert second.wait(30.0) == 1
    (line,) = ros.output(second).splitlines()[-1:]
    expected = f"another bridge connects domain {ros2.domain} already ("
    assert "[FATAL]" in line and expected in line and "~domain_id or ~prefix" in line
    prefixed = ros2.bridge("__name:=third", "_prefix:=other")
    peer = ros2.peer()
    wait_until(lambda: "/other/arm/joint_states" in peer.topics(), "both have topics")
    peer.listen("/arm/joint_states", STATE)
    connect(peer, "/arm/joint_states", out, JointState())
    assert first.poll() is None and prefixed.poll() is None


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["_interface:=eth7"], "interface: no network interface 'eth7'"),
        (["_domain_id:=233"], "domain_id: must be"),
    ],
    ids=["interface", "domain"],
)
def test_wrong_parameters_end_the_bridge_with_one_line(ros, ros2, words, message):
    bridge = ros2.bridge(*words)
    assert bridge.wait(30.0) == 1
    fatal = [line for line in ros.output(bridge).splitlines() if "[FATAL]" in line]
    assert len(fatal) == 1 and message in fatal[0] and "Traceback" not in ros.output(bridge)


@pytest.mark.thorough
def test_wrong_variable_ends_the_bridge_with_one_line(ros):
    bridge = ros.start(["rosrun", "rpbi_ros2", "ros2_bridge_node.py"], ROS_DOMAIN_ID="lab")
    assert bridge.wait(60.0) == 1
    assert "ROS_DOMAIN_ID: expected a number from 0 to 232, got 'lab'" in ros.output(bridge)


def test_missing_extra_is_named(ros, tmp_path):
    (tmp_path / "cyclonedds.py").write_text("raise ImportError")
    path = f"{tmp_path}:{os.environ['PYTHONPATH']}"
    bridge = ros.start(["rosrun", "rpbi_ros2", "ros2_bridge_node.py"], PYTHONPATH=path)
    assert bridge.wait(60.0) == 1
    assert "'cyclonedds' is not installed: ./rpbi setup ros2" in ros.output(bridge).splitlines()[-1]


def test_hostile_messages_are_dropped_and_others_pass(ros, ros2):
    """Cyclone DDS itself compares each message with its type."""
    twists = ros.listen("/base/cmd_vel", Twist)
    bridge, peer = ros2.bridge(), ros2.peer()
    peer.write("/base/cmd_vel", "geometry_msgs/msg/Twist")
    wait_until(lambda: peer.readers("/base/cmd_vel"), "the bridge reads")
    for broken in (b"\0\1\0\0\1", b"\0\1\0\0" + bytes(8), b"\0\1\0\0" + bytes(400)):
        with contextlib.suppress(RuntimeError):  # rclpy refuses some itself
            peer.publish("/base/cmd_vel", broken)
    peer.publish("/base/cmd_vel", {"linear": {"x": 0.25}})
    wait_until(lambda: any(each.linear.x == 0.25 for each in twists.messages), "the other message passes")
    lines = [line for line in ros.output(bridge).splitlines() if "/base/cmd_vel" in line]
    assert lines and all("failed" in line or "refused" in line for line in lines) and bridge.poll() is None


@pytest.mark.thorough
def test_unknown_type_is_named_and_others_pass(ros, ros2, publisher):
    publisher("/plan", JointTrajectoryControllerState)
    out = publisher("/arm/joint_states", JointState)
    bridge, peer = ros2.bridge(), ros2.peer()
    peer.listen("/arm/joint_states", STATE)
    connect(peer, "/arm/joint_states", out, JointState())
    line = "not connected with ROS 2: control_msgs/JointTrajectoryControllerState has other fields in ROS 2"
    assert ros.output(bridge).count(line) == 1 and "/plan" not in peer.topics()


@pytest.mark.thorough
def test_other_publisher_of_a_topic_is_named_once(ros, ros2, publisher):
    publisher("/arm/joint_states", JointState)
    bridge, peer = ros2.bridge(), ros2.peer()
    peer.write("/arm/joint_states", STATE)
    text = "has other publishers of /arm/joint_states: is it the domain of another robot?"
    wait_until(lambda: text in ros.output(bridge), "it is named")
    assert ros.output(bridge).count(text) == 1 and bridge.poll() is None


@pytest.mark.thorough
def test_requests_without_sense_are_refused(ros, ros2):
    bridge, peer = ros2.bridge(), ros2.peer()
    request, text = "/rpbi/ros2/request", "std_msgs/msg/String"
    peer.listen("/rpbi/ros2/response", text)
    peer.write(request, text)
    wait_until(lambda: peer.readers(request), "the bridge reads")

    def is_answered() -> bool:
        peer.publish(request, {"data": '{"id": "fly", "call": "fly", "arguments": {}}'})
        return bool(peer.count("/rpbi/ros2/response"))

    wait_until(is_answered, "it answers")
    for bad in ("", "[]", "{}", "[" * 5000, '{"id": 1, "call": "start", "arguments": {}}', "x" * 2_000_000):
        peer.publish(request, {"data": bad})
    for call, arguments in (("step", '{"steps": "many"}'), ("move", "{}"), ("start", "{}"), ("start", "{}")):
        peer.publish(request, {"data": f'{{"id": "{call}", "call": "{call}", "arguments": {arguments}}}'})

    def answers() -> list[str]:
        return [each["data"] for each in peer.messages("/rpbi/ros2/response")]

    wait_until(lambda: all(f'"id": "{call}"' in " ".join(answers()) for call in ("step", "move", "start")), "answers")
    assert all('"success": false' in each for each in answers()) and "unknown call 'fly'" in answers()[0]
    assert "request from ROS 2 refused" in ros.output(bridge) and bridge.poll() is None
