"""Nodes of devices without windows, as programs: what stands in for the hardware at one end, topics at the other."""

from __future__ import annotations

import os
import pty
import signal
import termios

import pytest
import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import Twist, Vector3
from keyboard.msg import Key
from ros_system import find_executable, stop_group, wait_until
from sensor_msgs.msg import Joy, JoyFeedback, JoyFeedbackArray

from operator_node.emulators.spacenavd import SpacenavDaemon

LOOK = "looking for it once a second"


@pytest.mark.quick
def test_6d_mouse_is_found_later_moves_and_ends_at_rest(ros, tmp_path):
    path = tmp_path / "spnav.sock"
    joy, own, twist, offset = (
        ros.listen(topic, kind)
        for topic, kind in (
            ("joy", Joy),
            ("spacenav/joy", Joy),
            ("spacenav/twist", Twist),
            ("spacenav/offset", Vector3),
        )
    )
    diagnostics = ros.listen("/diagnostics", DiagnosticArray)
    options = ["_full_scale:=100", "_linear_scale:=[2, 3, 4]", "_autorepeat_rate:=0", "_static_count_threshold:=300"]
    node = ros.start(["rosrun", "operator_node", "spacenav_node.py", *options], SPNAV_SOCKET=str(path))
    wait_until(lambda: LOOK in ros.output(node), "it says that there is none")
    assert str(path) in ros.output(node)
    wait_until(lambda: diagnostics.messages, "diagnostics come")
    assert diagnostics.messages[-1].status[0].level == DiagnosticStatus.ERROR

    daemon = SpacenavDaemon(path)
    wait_until(lambda: all(each.is_connected for each in (joy, own, twist, offset)), "all are connected")
    wait_until(lambda: diagnostics.messages[-1].status[0].level == DiagnosticStatus.OK, "it is well")
    wait_until(lambda: _moved(daemon, joy), "it moves")
    moved = next(message for message in joy.messages if any(message.axes))
    assert moved.axes == pytest.approx((0.3, -0.1, 0.2, 0.0, 0.0, 0.5)) and moved.header.frame_id == "spacenav"
    assert abs((moved.header.stamp - rospy.Time.now()).to_sec()) < 60.0
    wait_until(lambda: any(message.linear.x for message in twist.messages), "the twist comes")
    moved = next(message for message in twist.messages if message.linear.x)
    assert (moved.linear.x, moved.linear.y, moved.linear.z) == pytest.approx((0.6, -0.3, 0.8))
    assert (moved.angular.x, moved.angular.y, moved.angular.z) == pytest.approx((0.0, 0.0, 0.5))
    wait_until(lambda: any(any(message.axes) for message in own.messages), "its own topic has it, too")
    wait_until(lambda: offset.messages, "and so has that of the offset")

    daemon.press(1)
    wait_until(lambda: joy.messages[-1].buttons == (0, 1), "it is pressed")
    assert stop_group(node) == 0
    wait_until(lambda: not any((*joy.messages[-1].axes, *joy.messages[-1].buttons)), "the last message is at rest")
    stamps = joy.stamps_ns
    assert stamps == sorted(stamps)
    daemon.close()


def _moved(daemon: SpacenavDaemon, joy) -> bool:
    daemon.move(10, 20, 30, 0, 50, 0)
    return any(any(message.axes) for message in joy.messages)


def test_daemon_killed_during_a_motion_leaves_the_axes_at_rest(ros, tmp_path):
    """And one that comes back is taken up; the emulator for users moves each axis in turn."""
    path = str(tmp_path / "spnav.sock")
    command = ["rosrun", "operator_node", "spacenavd_emulator.py", "--socket", path]
    emulator = ros.start(command)
    joy = ros.listen("joy", Joy)
    node = ros.start(["rosrun", "operator_node", "spacenav_node.py", f"_socket:={path}", "_full_scale:=350"])
    wait_until(lambda: any(abs(value) == 1.0 for each in joy.messages[-1:] for value in each.axes), "it moves")
    emulator.send_signal(signal.SIGKILL)
    emulator.wait()
    wait_until(lambda: not any(joy.messages[-1].axes), "it is at rest")
    wait_until(lambda: LOOK in ros.output(node) or "has gone" in ros.output(node), "it says why")
    ros.start(command)
    wait_until(lambda: "it is available now" in ros.output(node), "it is taken up again")
    wait_until(lambda: any(joy.messages[-1].axes), "it moves again")


def test_virtual_gamepad_moves_and_rumbles(ros):
    joy = ros.listen("joy", Joy)
    node = ros.start(["rosrun", "operator_node", "joy_node.py", "_virtual:=true", "_deadzone:=0.5"])
    first = joy.wait_for(1)[0]
    assert first.axes == (0.0,) * 4 + (1.0,) * 2 + (0.0,) * 2 and len(first.buttons) == 11
    move = rospy.Publisher("joy/virtual", Joy, queue_size=1)
    rumble = rospy.Publisher("joy/set_feedback", JoyFeedbackArray, queue_size=1)
    wait_until(lambda: move.get_num_connections() and rumble.get_num_connections(), "it listens")
    rumble.publish(JoyFeedbackArray([JoyFeedback(JoyFeedback.TYPE_RUMBLE, 0, float("nan"))]))
    rumble.publish(JoyFeedbackArray([JoyFeedback(JoyFeedback.TYPE_RUMBLE, 0, 0.5)]))
    move.publish(Joy(axes=[0.75, -1.0, 0.4], buttons=[0, 1]))
    wait_until(lambda: joy.messages[-1].buttons[1] == 1, "it is pressed")
    assert joy.messages[-1].axes[:3] == pytest.approx((0.5, -1.0, 0.0), abs=1e-4)
    for publisher in (move, rumble):
        publisher.unregister()
    assert stop_group(node) == 0
    wait_until(lambda: not any(joy.messages[-1].buttons), "the last message is at rest")
    assert joy.messages[-1].axes == first.axes
    assert "refused" not in ros.output(node)


def test_keyboard_by_a_terminal_and_ctrl_c_in_it(ros):
    """The terminal is as it was afterwards."""
    ours, theirs = pty.openpty()
    before = termios.tcgetattr(theirs)
    joy, down = ros.listen("joy", Joy), ros.listen("keyboard/keydown", Key)
    options = ["_terminal:=true", "_axes:=[[DOWN, UP]]", "_terminal_hold_s:=30.0"]
    in_terminal = f'exec "$0" "$@" <{os.ttyname(theirs)}'
    node = ros.start(["sh", "-c", in_terminal, find_executable("operator_node", "keyboard_node.py"), *options])
    wait_until(lambda: joy.is_connected and down.is_connected, "it listens")
    wait_until(lambda: termios.tcgetattr(theirs) != before, "it reads the terminal; what is typed before is dropped")
    os.write(ours, b"\x1b[A")
    wait_until(lambda: down.messages and joy.messages[-1].axes == (1.0,), "the key is held")
    assert down.messages[0].code == Key.KEY_UP
    os.write(ours, b"\x03")
    assert node.wait(60.0) == 0
    wait_until(lambda: joy.messages[-1].axes == (0.0,), "the last message is at rest")
    assert termios.tcgetattr(theirs) == before
    for end in (ours, theirs):
        os.close(end)


def test_wrong_options_end_the_node_and_are_named(ros):
    """Before the device is looked for."""
    node = ros.start(["rosrun", "operator_node", "joy_node.py", "_deadzone:=1.5", "_autorepeat_rate:=-1"])
    other = ros.start(["rosrun", "operator_node", "device_node.py", "_device:=joystik"])
    assert node.wait(60.0) == other.wait(60.0) == 1
    assert "deadzone" in ros.output(node)
    assert "unknown device 'joystik'" in ros.output(other) and "did you mean 'joystick'" in ros.output(other)
