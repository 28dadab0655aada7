"""Bridges and programs that end and return, and bridges that cannot start."""

from __future__ import annotations

import os
import signal

import pytest
from ros2_system import STATE, connect
from ros_system import RosSystem, wait_until
from sensor_msgs.msg import JointState

from custom_ros_tools.errors import ConfigError, InterfaceError
from rpbi_ros2.config import BridgeConfig

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


def test_wrong_interface_ends_the_bridge_with_one_line(ros, ros2):
    bridge = ros2.bridge("_interface:=eth7")
    assert bridge.wait(30.0) == 1
    fatal = [line for line in ros.output(bridge).splitlines() if "[FATAL]" in line]
    assert len(fatal) == 1 and "interface: no network interface 'eth7'" in fatal[0]
    assert "Traceback" not in ros.output(bridge)


@pytest.mark.parametrize("number", [-1, 233])
def test_wrong_domain_is_refused(number):
    with pytest.raises(ConfigError, match="domain_id: must be"):
        BridgeConfig.parse({"domain_id": number}, "parameters")
    assert BridgeConfig.parse({"domain_id": 232}, "parameters").domain({}) == 232


@pytest.mark.parametrize("text", ["lab", "233", "-1"])
def test_wrong_variable_is_refused(text):
    with pytest.raises(InterfaceError, match=f"ROS_DOMAIN_ID: expected a number from 0 to 232, got '{text}'"):
        BridgeConfig().domain({"ROS_DOMAIN_ID": text})
    assert BridgeConfig().domain({"ROS_DOMAIN_ID": "5"}) == 5


@pytest.mark.thorough
def test_missing_extra_is_named(ros, tmp_path):
    (tmp_path / "cyclonedds.py").write_text("raise ImportError")
    path = f"{tmp_path}:{os.environ['PYTHONPATH']}"
    bridge = ros.start(["rosrun", "rpbi_ros2", "ros2_bridge_node.py"], PYTHONPATH=path)
    assert bridge.wait(60.0) == 1
    assert "'cyclonedds' is not installed: ./rpbi setup ros2" in ros.output(bridge).splitlines()[-1]


@pytest.mark.thorough
def test_launch_file_of_an_example_starts_the_bridge(ros, ros2):
    command = ["roslaunch", "rpbi_examples", "run_kuka.launch", "headless:=true", "ros2:=true"]
    ros.start(command, ROS_DOMAIN_ID=str(ros2.domain))
    peer = ros2.peer()
    peer.listen("/rpbi/kuka_lwr/joint_states", STATE)
    wait_until(lambda: peer.count("/rpbi/kuka_lwr/joint_states"), "the robot is seen")
