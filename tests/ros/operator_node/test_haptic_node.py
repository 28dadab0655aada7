"""The haptic node with emulated devices that speak the true protocols: what moves, what is felt, and that force ends."""

from __future__ import annotations

import math
import os
import signal

import pytest
import rospy
from geometry_msgs.msg import PoseStamped, TwistStamped, Vector3, WrenchStamped
from node_world import publishing
from ros_system import RosSystem, wait_until
from sensor_msgs.msg import Joy
from std_srvs.srv import SetBool, Trigger
from tf2_msgs.msg import TFMessage

from operator_node.emulators.haply import HaplyEmulator
from operator_node.msg import HapticState

DOWN = (0.0, 0.0, -0.03)


def start_haptic_node(ros: RosSystem, device: str, device_options: dict[str, object], **parameters: object):
    """Starts the node and waits until its device is connected."""
    state = ros.listen("/haptics/state", HapticState)
    rospy.set_param("/haptic_node", {"device": device, "device_options": device_options, **parameters})
    process = ros.start(["rosrun", "operator_node", "haptic_node.py"])
    wait_until(lambda: state.messages and state.messages[-1].connected, "the device is connected", 60.0)
    return process, state


class Wrenches:
    """Publishes a force on the tool at 250 Hz, as a simulator does, from a process that can be stopped."""

    def __init__(self, ros: RosSystem, force_n: float) -> None:
        self.process = ros.start_program("pushes_a_tool.py", str(force_n))

    def fall_silent(self) -> None:
        os.killpg(self.process.pid, signal.SIGSTOP)

    def go_on(self) -> None:
        os.killpg(self.process.pid, signal.SIGCONT)


@pytest.fixture
def haply():
    """A Haply with a hand that wants to be 3 cm lower after a moment."""
    emulator = HaplyEmulator(lambda time_s: DOWN if time_s % 2.0 > 1.0 else (0.0, 0.0, 0.0), key="values")
    emulator.start()
    yield emulator
    emulator.stop()


def test_haply_moves_a_frame_and_is_sent_forces_that_end_when_the_simulator_stops(ros, haply):
    force, pose, joy = (
        ros.listen(topic, kind)
        for topic, kind in (("/haptics/force", WrenchStamped), ("/haptics/pose", PoseStamped), ("/joy", Joy))
    )
    twist, tf = ros.listen("/haptics/twist", TwistStamped), ros.listen("/tf", TFMessage)
    options = {"url": f"ws://localhost:{haply.port}"}
    _, state = start_haptic_node(ros, "haply", options, target_frame_id="target", energy_allowance_j=0.1)
    wrenches = Wrenches(ros, 2.0)
    wait_until(lambda: max(map(abs, haply.force)) > 1.0, "the hand feels the force, by the key that the service knows")
    wait_until(lambda: min(each.pose.position.z for each in pose.wait_for()) < -0.02, "the handle goes down")
    wait_until(lambda: min(each.axes[2] for each in joy.wait_for()) < -0.15, "and joy says so")
    assert max(abs(value) for each in joy.messages for value in each.axes) <= 1.0
    assert min(each.twist.linear.z for each in twist.wait_for()) < -0.01

    def target_z():
        found = [each for message in list(tf.messages) for each in message.transforms]
        return min((each.transform.translation.z for each in found if each.child_frame_id == "target"), default=0.0)

    wait_until(lambda: target_z() < -0.015, "the target follows")
    said = state.messages[-1]
    assert said.device == "haply" and said.energy >= said.energy_bound
    assert "force not taken" in said.fault_names, "it tried the other key first"
    for _ in range(2):
        wrenches.fall_silent()
        wait_until(lambda: max(map(abs, haply.force)) == 0.0, "no force without the simulator", every_s=0.001)
        wait_until(lambda: state.messages[-1].delay > 0.05, "the state says how long the tool has been silent")
        wrenches.go_on()
        wait_until(lambda: max(map(abs, haply.force)) > 0.5, "the force is back with it")
    assert all(math.hypot(f.x, f.y, f.z) <= 8.0 for f in (each.wrench.force for each in force.messages))


def test_a_haply_that_hangs_up_is_back_by_itself_and_nothing_jumps(ros):
    emulator = HaplyEmulator(lambda time_s: DOWN)
    emulator.start()
    _, state = start_haptic_node(ros, "haply", {"url": f"ws://localhost:{emulator.port}"})
    pose, joy = ros.listen("/haptics/pose", PoseStamped), ros.listen("/joy", Joy)
    wait_until(lambda: pose.wait_for()[-1].pose.position.z < -0.02, "the handle is below")
    port = emulator.port
    emulator.stop()
    wait_until(lambda: not state.messages[-1].connected, "it is gone")
    assert str(port) in state.messages[-1].message
    there = HaplyEmulator(lambda time_s: (0.0, 0.0, 0.0), port=port)
    before = len(joy.messages)
    there.start()
    try:
        wait_until(lambda: state.messages[-1].connected, "it is back")
        first = joy.wait_for(before + 1)[before]
        assert first.axes == pytest.approx((0.0, 0.0, 0.0), abs=0.05), "the handle is elsewhere, the tool goes on"
    finally:
        there.stop()


@pytest.mark.parametrize("driver", ["omni", "touch_x"])
def test_touch_is_sent_zero_when_the_simulator_stops_and_when_the_node_ends(ros, driver):
    """The driver holds the last force for ever, so that silence on our side would not do."""
    rospy.set_param("/touch_emulator", {"driver": driver, "depth": 0.03})
    ros.start(["rosrun", "operator_node", "touch_emulator.py"])
    felt = ros.listen("/phantom/felt", Vector3)
    process, state = start_haptic_node(ros, "touch", {"driver": driver}, energy_allowance_j=0.1)
    joy = ros.listen("/joy", Joy)
    wrenches = Wrenches(ros, 2.0)
    wait_until(lambda: felt.messages and felt.messages[-1].z > 1.0, "the hand feels the force")
    wait_until(lambda: min(each.axes[2] for each in joy.wait_for()) < -0.1, "the handle goes down")
    assert state.messages[-1].fault_names == []
    wrenches.fall_silent()
    wait_until(lambda: felt.messages[-1].z == 0.0, "zero is sent", every_s=0.001)
    wrenches.go_on()
    wait_until(lambda: felt.messages[-1].z > 0.5, "the force is back")
    os.killpg(process.pid, signal.SIGINT)
    wait_until(lambda: process.poll() is not None, "the node ends")
    wait_until(lambda: felt.messages[-1].z == 0.0, "with zero")


def test_switched_off_there_is_no_device_and_wrong_forces_are_refused(ros):
    options = {"depth_m": 0.02, "wait_s": 30.0}
    process, state = start_haptic_node(ros, "scripted", options, energy_allowance_j=0.1)
    force = ros.listen("/haptics/force", WrenchStamped)
    with publishing("/haptics/wrench", WrenchStamped) as wrench:
        bad = WrenchStamped()
        bad.wrench.force.z = math.nan
        for _ in range(20):
            wrench.publish(bad)
        wait_until(lambda: "expected finite numbers, got 0, 0, nan" in ros.output(process), "it is named")
    assert all(math.isfinite(each.wrench.force.z) for each in force.wait_for())
    assert ros.call("/haptics/reset", Trigger).success
    assert ros.call("/haptics/toggle", SetBool, False).success
    wait_until(lambda: not state.messages[-1].connected, "it is closed")
    assert not ros.call("/haptics/toggle", SetBool, False).success
    assert ros.call("/haptics/toggle", SetBool, True).success
    wait_until(lambda: state.messages[-1].connected, "it is open again")


@pytest.mark.parametrize(
    ("parameters", "told"),
    [
        ({"device": "haptly"}, "unknown haptic device 'haptly'"),
        ({"device": "scripted", "device_options": {"depth": 1}}, "depth"),
        ({"device": "scripted", "expiry_s": 0.5}, "expiry_s"),
        ({"device": "scripted", "way_low": [0.1, 0.0, 0.0]}, "way_low"),
    ],
)
def test_wrong_parameters_are_told(ros, parameters, told):
    rospy.set_param("/haptic_node", parameters)
    process = ros.start(["rosrun", "operator_node", "haptic_node.py"])
    assert wait_until(lambda: process.poll(), "it ends") == 1
    assert told in ros.output(process)
