"""`keyboard_to_joy.py`: maps held keys to the axes and buttons of `joy`."""

import math
import threading
import time

import rospy
from keyboard.msg import Key
from pydantic import Field
from sensor_msgs.msg import Joy
from std_msgs.msg import Header

from custom_ros_tools.errors import collecting_problems
from custom_ros_tools.ros.lifecycle.parameters import private_config, private_parameters
from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.ros.lifecycle.wall_time import WallTimer
from custom_ros_tools.schema import ConfigModel, Hz, ListOf
from operator_node.devices.keys import KeyAxes, KeyName, KeyPair
from operator_node.input_topics import QUEUE_SIZE, SecondsOrOff, WatchedInput, stamp

NAME = "keyboard_to_joy"
FRAME_ID = "keyboard"
DISORDER_S = 5.0
"""Longest time by which a press may arrive after its release [s].

If a press arrives later and has an earlier stamp than the release, the clock was set back.
"""


class KeyboardToJoyConfig(ConfigModel):
    """Keys of a keyboard that act as the axes and buttons of a joystick."""

    axes: ListOf[KeyPair] = Field(
        description="Two keys for each axis: the key that makes the axis -1 and the key that makes it 1."
    )
    buttons: ListOf[KeyName] = Field((), description="One key for each button.")


class KeyboardToJoyParameters(ConfigModel):
    """Rate of the messages on `joy`, and longest time for which a key counts as held."""

    hz: Hz = Field(
        100.0, description="Rate of the published message, in wall time; changes of keys are published at once."
    )
    key_timeout_s: SecondsOrOff = Field(
        0.0,
        description="Time for which a key counts as held after it went down, for keyboards that repeat held keys but "
        "may miss a release; 0 waits for the release.",
    )


class KeyboardToJoy:
    """Publishes `joy` from `keyboard/keydown` and `keyboard/keyup`, at a fixed rate and whenever a key changes.

    Repeated presses, and releases without a press, change nothing. Messages on the two topics may arrive in wrong
    order. A press is therefore ignored if a release with a later stamp has already arrived. When the keyboard's node
    ends, all keys count as released.

    Raises:
        ConfigError: If `~config` or a parameter is wrong.
    """

    def __init__(self) -> None:
        with collecting_problems() as part:
            with part():
                config = private_config(KeyboardToJoyConfig)
            with part():
                parameters = private_parameters(KeyboardToJoyParameters)
        self._axes = KeyAxes(config.axes, config.buttons)
        self._timeout_s = parameters.key_timeout_s
        self._lock = threading.Lock()
        self._pressed_s: dict[int, float] = {}
        self._released: dict[int, tuple[rospy.Time, float]] = {}
        self._publisher = rospy.Publisher("joy", Joy, queue_size=QUEUE_SIZE, tcp_nodelay=True)
        self._down = WatchedInput("keyboard/keydown", Key, self._press)
        self._up = WatchedInput("keyboard/keyup", Key, self._release)
        WallTimer(parameters.hz, self._repeat)

    def _press(self, key: Key) -> None:
        with self._lock:
            stamp_then, then_s = self._released.get(key.code, (rospy.Time(), -math.inf))
            if key.header.stamp < stamp_then and time.monotonic() - then_s < DISORDER_S:
                return
            is_new = key.code not in self._pressed_s
            self._pressed_s[key.code] = time.monotonic()
            if is_new:
                self._publish()

    def _release(self, key: Key) -> None:
        with self._lock:
            self._released[key.code] = key.header.stamp, time.monotonic()
            if self._pressed_s.pop(key.code, None) is not None:
                self._publish()

    def _repeat(self) -> None:
        with self._lock:
            if self._pressed_s and self._down.has_ceased("all keys count as released"):
                self._pressed_s.clear()
            if self._timeout_s:
                since_s = time.monotonic() - self._timeout_s
                self._pressed_s = {code: at_s for code, at_s in self._pressed_s.items() if at_s >= since_s}
            self._publish()

    def _publish(self) -> None:
        reading = self._axes.reading(self._pressed_s.keys())
        self._publisher.publish(Joy(Header(stamp=stamp(), frame_id=FRAME_ID), reading.axes, reading.buttons))


def main() -> None:
    """Runs the node."""
    run_node(NAME, KeyboardToJoy)
