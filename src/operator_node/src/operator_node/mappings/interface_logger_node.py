"""`operator_interface_logger`: publishes the operator's signals of the last seconds as one message."""

import threading

import rospy
from pydantic import Field
from std_msgs.msg import Float64MultiArray, MultiArrayDimension

from custom_ros_tools.ros.lifecycle.parameters import private_parameters
from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning, WallTimer
from custom_ros_tools.schema import ConfigModel, HzOrOff, Seconds
from operator_node.input_topics import stamp
from operator_node.parser import SignalWindow

NAME = "operator_interface_logger"
QUEUE_SIZE = 100
"""Largest number of queued signals. It is large so that no signal is lost on a busy machine."""


class LoggerParameters(ConfigModel):
    """Time span of the signals in a message, and rate at which messages are published."""

    window_duration: Seconds = Field(1.0, description="Time span of the signals in the published window.")
    hz: HzOrOff = Field(0.0, description="Rate of the window, in wall time; 0 publishes the window with each signal.")


class InterfaceLogger:
    """Publishes the recent signals of `operator_node/signal` on `operator_node/window`.

    A message is published with each signal, or at the rate `~hz`. The message's data are records
    `[t, s_1, ..., s_n]`, oldest first, where t is the signal's arrival in ROS time [s].

    Raises:
        ConfigError: If a parameter is wrong.
    """

    def __init__(self) -> None:
        parameters = private_parameters(LoggerParameters)
        self._publishes_each = not parameters.hz
        self._window = SignalWindow(parameters.window_duration)
        self._lock = threading.Lock()
        self._warn = ThrottledWarning()
        self._publisher = rospy.Publisher("operator_node/window", Float64MultiArray, queue_size=1, tcp_nodelay=True)
        self._subscriber = rospy.Subscriber(
            "operator_node/signal", Float64MultiArray, self._on_signal, queue_size=QUEUE_SIZE, tcp_nodelay=True
        )
        if parameters.hz:
            WallTimer(parameters.hz, self._publish_present)

    def _on_signal(self, message: Float64MultiArray) -> None:
        with self._lock:
            try:
                self._window.add(stamp().to_sec(), message.data)
            except ValueError as error:
                self._warn(self._subscriber.resolved_name, f"message refused: {error}")
                return
            if self._publishes_each:
                self._publish()

    def _publish_present(self) -> None:
        with self._lock:
            had_any = self._window.size > 0
            self._window.forget(stamp().to_sec())
            if had_any:  # one empty message follows after the last signal has expired
                self._publish()

    def _publish(self) -> None:
        message = Float64MultiArray(data=self._window.data())
        length = self._window.size + 1
        message.layout.dim = [
            MultiArrayDimension("records", len(message.data) // length, len(message.data)),
            MultiArrayDimension("time and signal", length, length),
        ]
        self._publisher.publish(message)


def main() -> None:
    """Runs the node."""
    run_node(NAME, InterfaceLogger)
