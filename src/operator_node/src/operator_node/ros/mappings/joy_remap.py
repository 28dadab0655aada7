"""`joy_remap`: a device that tells changes only, at a steady rate."""

import copy
import threading

import rospy
from sensor_msgs.msg import Joy

from custom_ros_tools.ros.lifecycle.parameters import private_parameters
from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.ros.lifecycle.wall_time import WallTimer
from operator_node.node_configs import JoyRemapParameters
from operator_node.ros.stamps import stamp
from operator_node.ros.watched_input import QUEUE_SIZE, WatchedInput

NAME = "joy_remap"


class JoyRemap:
    """Repeats the newest message of `joy_in` on `joy_out` with the present time, from the first one on.

    When input ceases, one message of zeros follows, and then nothing until input comes again.

    Raises:
        ConfigError: If a parameter is wrong.
    """

    def __init__(self) -> None:
        parameters = private_parameters(JoyRemapParameters)
        self._lock = threading.Lock()
        self._joy: Joy | None = None
        self._publisher = rospy.Publisher("joy_out", Joy, queue_size=QUEUE_SIZE, tcp_nodelay=True)
        self._input = WatchedInput("joy_in", Joy, self._take, parameters.input_timeout_s)
        WallTimer(parameters.hz, self._publish)

    def _take(self, joy: Joy) -> None:
        with self._lock:
            self._joy = joy

    def _publish(self) -> None:
        with self._lock:
            if self._joy is None:
                return
            message = copy.copy(self._joy)
            if self._input.has_ceased("axes and buttons are zero"):
                message.axes, message.buttons = [0.0] * len(message.axes), [0] * len(message.buttons)
                self._joy = None
            message.header = copy.copy(message.header)
            message.header.stamp = stamp()
            self._publisher.publish(message)


def main() -> None:
    """Runs the node."""
    run_node(NAME, JoyRemap)
