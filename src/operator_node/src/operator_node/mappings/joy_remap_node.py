"""`joy_remap`: repeats the messages of a device at a steady rate, for devices that report only changes."""

import copy
import math
import threading

import rospy
from pydantic import Field
from sensor_msgs.msg import Joy

from custom_ros_tools.ros.lifecycle.parameters import private_parameters
from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning, WallTimer
from custom_ros_tools.schema import Hz
from operator_node.input_topics import QUEUE_SIZE, InputParameters, WatchedInput, stamp

NAME = "joy_remap"


class JoyRemapParameters(InputParameters):
    """Rate at which the newest message is repeated, and time without input after which zeros are sent."""

    hz: Hz = Field(100.0, description="Rate of the published message, in wall time.")


class JoyRemap:
    """Repeats the newest message on `joy_in` at a steady rate on `joy_out`, with the present time as stamp.

    When input ceases or is not finite, one message with zeros is published. Further messages follow when valid input
    arrives again.

    Raises:
        ConfigError: If a parameter is wrong.
    """

    def __init__(self) -> None:
        parameters = private_parameters(JoyRemapParameters)
        self._lock = threading.Lock()
        self._joy: Joy | None = None
        self._is_refused = False
        self._warn = ThrottledWarning()
        self._publisher = rospy.Publisher("joy_out", Joy, queue_size=QUEUE_SIZE, tcp_nodelay=True)
        self._input = WatchedInput("joy_in", Joy, self._on_joy, parameters.input_timeout_s)
        WallTimer(parameters.hz, self._publish)

    def _on_joy(self, joy: Joy) -> None:
        is_refused = not all(map(math.isfinite, joy.axes))
        if is_refused:
            axes = ", ".join(f"{value:g}" for value in joy.axes)
            self._warn(self._input.topic, f"message refused, and all is zero: axes must be finite, got {axes}")
        with self._lock:
            self._is_refused = is_refused
            if self._joy is not None or not is_refused:
                self._joy = joy

    def _publish(self) -> None:
        with self._lock:
            if self._joy is None:
                return
            message = copy.copy(self._joy)
            if self._is_refused or self._input.has_ceased("axes and buttons are zero"):
                message.axes, message.buttons = [0.0] * len(message.axes), [0] * len(message.buttons)
                self._joy = None
            message.header = copy.copy(message.header)
            message.header.stamp = stamp()
            self._publisher.publish(message)


def main() -> None:
    """Runs the node."""
    run_node(NAME, JoyRemap)
