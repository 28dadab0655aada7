"""The haptic node with emulated devices that speak the true protocols: what moves, what is felt, that force ends."""

from __future__ import annotations

import math
import os
import signal
import subprocess
import time

import pytest
import rospy
from geometry_msgs.msg import PoseStamped, TwistStamped, Vector3, WrenchStamped
from node_world import publishing
from omni_msgs.msg import OmniFeedback
from ros_system import RosSystem, is_running, wait_until
from sensor_msgs.msg import Joy
from std_srvs.srv import SetBool, Trigger
from tf2_msgs.msg import TFMessage

from operator_node.device import DeviceError
from operator_node.emulators.haply_service import HaplyEmulator
from operator_node.haptics.devices.touch_topics import TouchConfig, TouchDevice
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


def test_haply_moves_a_frame_and_forces_end_with_the_simulator(ros, haply):
    force, pose, joy = (
        ros.listen(topic, kind)
        for topic, kind in (("/haptics/force", WrenchStamped), ("/haptics/pose", PoseStamped), ("/joy", Joy))
    )
    twist, tf = ros.listen("/haptics/twist", TwistStamped), ros.listen("/tf", TFMessage)
    options = {"url": f"ws://localhost:{haply.port}"}
    _, state = start_haptic_node(
        ros, "haply", options, target_frame_id="target", energy_allowance_j=0.1, energy_refill_w=0.1
    )
    wrenches = Wrenches(ros, 2.0)
    words = "the hand feels the force, by the key that the service knows"
    wait_until(lambda: max(map(abs, haply.force)) > 1.0, words, every_s=0.001)  # on a busy machine it is so for moments
    wait_until(lambda: min(each.pose.position.z for each in pose.wait_for()) < -0.02, "the handle goes down")
    wait_until(lambda: max(abs(each.axes[2]) for each in joy.wait_for()) > 0.15, "and joy says so")
    assert max(abs(value) for each in joy.messages for value in each.axes) <= 1.0
    assert min(each.twist.linear.z for each in twist.wait_for()) < -0.01

    def target_range():
        """Returns how far the target has moved up and down lately [m]; where it stands depends on when it began."""
        found = [each for message in tf.messages[-2000:] for each in message.transforms]
        heights = [each.transform.translation.z for each in found if each.child_frame_id == "target"]
        return max(heights) - min(heights) if heights else 0.0

    wait_until(lambda: target_range() > 0.015, "the target follows")
    said = state.messages[-1]
    assert said.device == "haply" and said.energy >= said.energy_bound
    wait_until(lambda: "force not taken" in state.messages[-1].fault_names, "the state says that it tried another key")
    for _ in range(2):
        wrenches.fall_silent()
        wait_until(lambda: max(map(abs, haply.force)) == 0.0, "no force without the simulator", every_s=0.001)
        wait_until(lambda: state.messages[-1].delay > 0.05, "the state says how long the tool has been silent")
        wrenches.go_on()
        wait_until(lambda: max(map(abs, haply.force)) > 0.5, "the force is back with it", every_s=0.001)
    assert all(math.hypot(f.x, f.y, f.z) <= 8.0 for f in (each.wrench.force for each in force.messages))


def test_disconnected_haply_returns_by_itself_without_a_jump(ros):
    emulator = HaplyEmulator(lambda time_s: DOWN)
    emulator.start()
    _, state = start_haptic_node(ros, "haply", {"url": f"ws://localhost:{emulator.port}"})
    pose, joy = ros.listen("/haptics/pose", PoseStamped), ros.listen("/joy", Joy)
    wait_until(lambda: pose.wait_for()[-1].pose.position.z < -0.02, "the handle is below")
    port = emulator.port
    emulator.stop()
    wait_until(lambda: not state.messages[-1].connected, "it is gone")
    gone = next(each for each in state.messages[::-1] if not each.connected)
    assert str(port) in gone.message
    there = HaplyEmulator(lambda time_s: (0.0, 0.0, 0.0), port=port)
    there.start()
    try:
        wait_until(lambda: state.messages[-1].connected, "it is back")
        first = wait_until(
            lambda: [each for each in joy.messages if each.header.stamp > gone.header.stamp], "it moves"
        )[0]
        assert first.axes == pytest.approx((0.0, 0.0, 0.0), abs=0.05), "the handle is elsewhere, the tool goes on"
    finally:
        there.stop()


def loop_of(node: subprocess.Popen) -> int:
    """Returns the id of the process in which the loop of a haptic node runs."""
    return int(subprocess.check_output(["pgrep", "-P", str(node.pid), "-f", "operator_node.haptics.loop"]))


def test_touch_receives_zero_when_the_simulator_or_node_ends(ros):
    """The driver holds the last force for ever, so that silence on our side would not do."""
    rospy.set_param("/touch_emulator", {"depth": 0.03})
    ros.start(["rosrun", "operator_node", "touch_emulator.py"])
    felt, joy = ros.listen("/phantom/felt", Vector3), ros.listen("/joy", Joy)
    process, state = start_haptic_node(ros, "touch", {}, energy_allowance_j=0.1, energy_refill_w=0.1)
    wrenches = Wrenches(ros, 2.0)
    wait_until(lambda: strongest_n(felt.messages) > 1.0, "the hand feels the force")
    wait_until(lambda: min(each.axes[2] for each in joy.wait_for()) < -0.1, "the handle goes down")
    assert {*state.messages[-1].fault_names} <= {"jump"}, "as a machine that stands still makes them"
    wrenches.fall_silent()
    wait_until(lambda: felt.messages[-1].z == 0.0, "zero is sent", every_s=0.001)
    before = len(felt.messages)
    wrenches.go_on()
    wait_until(lambda: strongest_n(felt.messages[before:]) > 0.5, "the force is back")
    os.killpg(process.pid, signal.SIGINT)
    wait_until(lambda: process.poll() is not None, "the node ends")
    wait_until(lambda: felt.messages[-1].z == 0.0, "with zero")


def test_touch_receives_zero_when_either_loop_or_node_is_killed(ros):
    rospy.set_param("/touch_emulator", {"depth": 0.03})
    ros.start(["rosrun", "operator_node", "touch_emulator.py"])
    felt, sent = ros.listen("/phantom/felt", Vector3), ros.listen("/phantom/force_feedback", OmniFeedback)
    process, state = start_haptic_node(ros, "touch", {}, energy_allowance_j=0.1, energy_refill_w=0.1)
    wait_until(lambda: "/haptic_node_device" in senders(sent.messages), "the loop is a node of its own")
    before = len(sent.messages)
    os.kill(loop_of(process), signal.SIGKILL)
    wait_until(lambda: "/haptic_node" in senders(sent.messages[before:]), "the node sends in its stead")
    wait_until(lambda: any("SIGKILL" in each.message and not each.connected for each in state.messages), "it is told")
    wait_until(lambda: state.messages[-1].connected, "it is back by itself")
    assert "touch: the process of its loop ended with signal SIGKILL, and is started again" in ros.output(process)
    before = len(felt.messages)
    Wrenches(ros, 2.0)
    wait_until(lambda: strongest_n(felt.messages[before:]) > 1.0, "the hand feels the force")
    loop = loop_of(process)
    for thread in os.listdir(f"/proc/{loop}/task"):  # with a real-time priority one of them could starve the others
        os.sched_setaffinity(int(thread), {min(os.sched_getaffinity(0))})
    os.killpg(process.pid, signal.SIGKILL)
    wait_until(lambda: not is_running(loop), "the loop ends by itself")
    wait_until(lambda: felt.messages[-1].z == 0.0, "with zero")


def strongest_n(felt: list[Vector3]) -> float:
    """Returns the strongest force upwards [N]; on a busy machine it may be felt for moments only."""
    return max((each.z for each in felt), default=0.0)


def senders(messages: list[OmniFeedback]) -> set[str]:
    return {each._connection_header["callerid"] for each in messages}


@pytest.mark.parametrize("driver", ["pose", "touch_x"])
def test_touch_by_the_drivers_of_the_release(ros, driver):
    """Axes of forces are x right, y up, z towards the person; ours x forward, y left, z up."""
    rospy.set_param("/touch_emulator", {"driver": driver, "depth": 0.03})
    ros.start(["rosrun", "operator_node", "touch_emulator.py"])
    felt = ros.listen("/phantom/felt", Vector3)
    device = TouchDevice(TouchConfig(driver=driver))
    wait_until(lambda: is_open(device), "its driver speaks")
    lowest, down = [0.0], [0.0]

    def go_on():
        reading = device.read()
        device.send((0.0, 0.0, 1.0), time.monotonic() + 0.016)
        if reading is not None:
            lowest.append(reading.position[2])
            down.append(reading.velocity[2] if reading.velocity else 0.0)
            assert reading.position[:2] == pytest.approx((0.0, 0.0), abs=1e-6)
        moves = driver == "pose" or min(down) < -0.01  # that driver reports no velocity
        return min(lowest) < -0.02 and moves and felt.messages and felt.messages[-1].z == 1.0

    wait_until(go_on, "the hand goes down and feels the force")
    device.close()
    wait_until(lambda: felt.messages[-1].z == 0.0, "zero is sent at the end")


def is_open(device: TouchDevice) -> bool:
    """Opens a device if it is there."""
    try:
        device.open()
    except DeviceError:
        return False
    return True


def test_switched_off_node_has_no_device_and_refuses_wrong_forces(ros):
    options = {"depth_m": 0.02, "wait_s": 30.0}
    process, state = start_haptic_node(ros, "scripted", options, energy_allowance_j=0.1, energy_refill_w=0.1)
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


def test_a_wrong_parameter_ends_the_node_with_its_name(ros):
    rospy.set_param("/haptic_node", {"device": "haptly"})
    process = ros.start(["rosrun", "operator_node", "haptic_node.py"])
    assert wait_until(lambda: process.poll(), "it ends") == 1
    assert "unknown haptic device 'haptly': known are haply, scripted, touch, virtual" in ros.output(process)
