"""Base class of the nodes that map `joy` to `operator_node/signal`."""

import math
import threading
from abc import ABC, abstractmethod
from collections.abc import Sequence

import numpy as np
import rospy
from numpy.typing import ArrayLike
from pydantic import Field
from sensor_msgs.msg import Joy
from std_msgs.msg import Float64MultiArray

from custom_ros_tools.node_configs import StartParameters
from custom_ros_tools.plugins import cause_of
from custom_ros_tools.ros.lifecycle.parameters import private_parameters
from custom_ros_tools.ros.lifecycle.run_node import leave_ros_on_signals
from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning, WallTimer
from custom_ros_tools.ros.rospy_internals import DirectSending
from custom_ros_tools.ros.services import Toggle, ToggleService
from custom_ros_tools.schema import HzOrOff
from custom_ros_tools.sockets import flush_buffered_sockets
from operator_node.input_topics import QUEUE_SIZE, InputParameters, WatchedInput

NAME = "operator_node"
LOOK_HZ = 50.0
"""Rate of the check whether input still arrives [Hz]."""


class OperatorParameters(StartParameters, InputParameters):
    """Private parameters of the nodes that map a device's axes to a signal."""

    repeat_hz: HzOrOff = Field(
        20.0,
        description="Rate at which a nonzero signal is published again while the input does not change; 0 disables "
        "repetition.",
    )


class OperatorNode(ABC):
    """Publishes a signal while the node is switched on. The service `operator_node/toggle` switches the node on or off.

    A subclass computes a signal in `callback` and passes the signal to `publish`. The signal is valid until the next
    signal. A nonzero signal is repeated `~repeat_hz` times a second, so that subscribers can distinguish a user who
    holds still from a node that has crashed. One zero signal is published when the node is switched off, when input
    ceases (`~input_timeout_s`), and when a message is refused.

    The constructor initialises the ROS node `operator_node`, unless the process is a ROS node already.

    Attributes:
        config: Content of the parameter `~config`, a dictionary.

    Raises:
        ConfigError: If a parameter is wrong.
    """

    def __init__(self) -> None:
        if not rospy.core.is_initialized():
            rospy.init_node(NAME, disable_signals=True)
            leave_ros_on_signals()
        self.config = rospy.get_param("~config", {})
        self._lock = threading.RLock()
        self._is_on = False
        self._in_force: tuple[float, ...] = ()
        self._warn = ThrottledWarning()
        self.post_init()
        parameters = private_parameters(OperatorParameters)
        self._publisher = rospy.Publisher(
            "operator_node/signal", Float64MultiArray, queue_size=QUEUE_SIZE, tcp_nodelay=True
        )
        self._sending = DirectSending.of(self._publisher, QUEUE_SIZE)
        self._toggle = Toggle("operator node", self._start, self._end)
        if parameters.start_on_init:
            self.start()
        self._joy = WatchedInput("joy", Joy, self._on_joy, parameters.input_timeout_s)
        ToggleService("operator_node/toggle", self.start, self.stop)
        rospy.on_shutdown(self._end)
        WallTimer(LOOK_HZ, self._look)
        if parameters.repeat_hz:
            WallTimer(parameters.repeat_hz, self._repeat)

    def post_init(self) -> None:  # noqa: B027 (most need none)
        """Hook for the initialisation of a subclass, called before the first message. `config` is already set."""

    @abstractmethod
    def callback(self, joy: Joy) -> None:
        """Maps a message to a signal, and publishes the signal by `publish`. The message's axes are finite.

        Raises:
            ValueError: If the message is invalid. The text of the error is logged as the reason.
        """

    def start(self) -> tuple[bool, str]:
        """Switches the node on. Returns whether the node was off before, and a message for the user."""
        return self._toggle.on()

    def stop(self) -> tuple[bool, str]:
        """Switches the node off. Returns whether the node was on before, and a message for the user."""
        return self._toggle.off()

    def publish(self, signal: ArrayLike) -> None:
        """Publishes a signal of one or more numbers, if the node is switched on.

        Raises:
            ValueError: If the signal is empty or not finite.
        """
        values = tuple(np.asarray(signal, dtype=float).ravel().tolist())
        if not values or not all(map(math.isfinite, values)):
            raise ValueError(f"its signal must be finite, got {', '.join(f'{v:g}' for v in values) or 'none'}")
        with self._lock:
            if self._is_on:
                self._in_force = values
                self._send(values)

    def spin(self) -> None:
        """Waits until ROS shuts down."""
        rospy.spin()

    def _start(self) -> None:
        with self._lock:
            self._is_on = True

    def _end(self) -> None:
        with self._lock:
            self._end_signal()
            self._is_on = False

    def _end_signal(self) -> None:
        with self._lock:
            if self._in_force:
                self._send([0.0] * len(self._in_force))
                self._in_force = ()

    def _on_joy(self, joy: Joy) -> None:
        with self._lock:
            if not self._is_on:
                return
            try:
                if not all(map(math.isfinite, joy.axes)):
                    raise ValueError(f"axes must be finite, got {', '.join(f'{v:g}' for v in joy.axes)}")
                self.callback(joy)
            except Exception as error:  # after any failure in a user's class, the signal must end
                reason = str(error) if isinstance(error, ValueError) else cause_of(error)
                self._warn(self._joy.topic, f"message refused: {reason}")
                self._end_signal()

    def _look(self) -> None:
        with self._lock:
            if any(self._in_force) and self._joy.has_ceased("the signal is zero"):
                self._end_signal()

    def _repeat(self) -> None:
        with self._lock:
            if any(self._in_force):
                self._send(self._in_force)

    def _send(self, values: Sequence[float]) -> None:
        """Sends a signal and waits until it is sent. rospy's own thread might lose the last signal at shutdown."""
        if self._sending is not None:
            self._sending.wrap_connections()
        self._publisher.publish(Float64MultiArray(data=values))
        flush_buffered_sockets()


def main(node: type[OperatorNode]) -> None:
    """Runs the node of a subclass of `OperatorNode` until ROS shuts down."""
    node().spin()
