"""Nodes with windows, as programs: real keys and drags at one end, topics at the other."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest
from keyboard.msg import Key
from ros_system import stop_group, wait_until
from sensor_msgs.msg import Joy

KEEPS_AN_ERROR = """
import gc, sys, threading
from operator_node.device import DeviceError
from operator_node.devices.window import DeviceWindow

def use():
    window = DeviceWindow("mouse", "mouse", 100, 100)
    window._note_closed()
    try:
        window.wait(0.01)
    except DeviceError as error:
        kept = error
        kept.itself = kept  # only the garbage collector frees it, later
    else:
        sys.exit("no error")
    window.close()

gc.disable()
use()
collector = threading.Thread(target=gc.collect)
collector.start()
collector.join()
"""


def test_kept_error_does_not_keep_its_window_alive(screen):
    """Tcl aborts the process when another thread than the window's frees it, as a garbage collector may."""
    program = [sys.executable, "-c", KEEPS_AN_ERROR]
    ended = subprocess.run(program, env={**os.environ, **screen.environment}, capture_output=True, text=True)
    assert ended.returncode == 0, ended.stderr


def test_keyboard_node_of_the_release_publishes_keys_and_final_releases(ros, screen):
    """`rosrun keyboard keyboard`; with no axes it is silent on `joy`, which `keyboard_to_joy.py` has."""
    down, up = ros.listen("keyboard/keydown", Key), ros.listen("keyboard/keyup", Key)
    node = ros.start(["rosrun", "keyboard", "keyboard"], **screen.environment)
    wait_until(lambda: down.is_connected and up.is_connected, "its topics are there")
    wait_until(lambda: [each for each in screen.windows() if each.title == "keyboard"], "its window is there")

    def typed() -> bool:
        screen.run("xdotool", "key", "b")
        return bool(up.messages)

    wait_until(typed, "it has the keyboard")
    assert {message.code for message in down.messages} == {Key.KEY_b}
    assert down.messages[0].header.stamp.to_sec() > 0
    screen.run("xdotool", "keydown", "Left")
    wait_until(lambda: down.messages[-1].code == Key.KEY_LEFT, "it is held")
    assert stop_group(node) == 0
    wait_until(lambda: up.messages[-1].code == Key.KEY_LEFT, "it is let go")
    screen.run("xdotool", "keyup", "Left")
    assert "refused" not in ros.output(node)


def test_mouse_moves_joy(ros, screen):
    joy = ros.listen("joy", Joy)
    node = ros.start(["rosrun", "operator_node", "mouse_node.py"], **screen.environment)
    joy.wait_for(1)
    screen.run("xdotool", "search", "--sync", "--onlyvisible", "--name", "^mouse$")  # before, it gets no mouse
    (place,) = (each for each in screen.windows() if each.title == "mouse")
    x, y = place.x + place.width // 2, place.y + place.height // 2
    wait_until(lambda: joy.messages and joy.is_connected, "it is connected")
    screen.run("xdotool", "mousemove", str(x), str(y), "mousedown", "1", "mousemove", str(x + 100), str(y - 50))
    wait_until(lambda: joy.messages[-1].axes[1] > 0.2, "it moves")
    assert joy.messages[-1].axes == pytest.approx((0.5, 0.25, 0.0))
    assert joy.messages[-1].buttons == (1, 0, 0)
    count = len(joy.messages)
    wait_until(lambda: len(joy.messages) > count + 2, "it is repeated")
    assert stop_group(node) == 0
    wait_until(lambda: not any(joy.messages[-1].axes), "the last message is at rest")
    screen.run("xdotool", "mouseup", "1")
