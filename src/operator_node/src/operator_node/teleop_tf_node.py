"""`teleop_tf_node.py`: broadcasts a TF frame that a user moves by velocity signals."""

import threading
import time

import rospy
from custom_srvs.srv import SetTransform, SetTransformRequest, SetTransformResponse
from geometry_msgs.msg import Transform
from pydantic import Field
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger, TriggerRequest, TriggerResponse
from teleop.srv import GetBoxLimits, GetBoxLimitsRequest, GetBoxLimitsResponse

from custom_ros_tools.errors import collecting_problems
from custom_ros_tools.node_configs import StartParameters
from custom_ros_tools.ros.lifecycle.parameters import private_config, private_parameters
from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning, WallTimer
from custom_ros_tools.ros.services import Toggle, ToggleService
from custom_ros_tools.ros.transform_messages import TransformTopic, position_in, quat_in, transform_message
from custom_ros_tools.transforms import rpy_of

from .input_topics import SecondsOrOff, WatchedInput
from .teleop import Teleop, TeleopConfig, TeleopPose

NAME = "teleop_tf_node"


class TeleopParameters(StartParameters):
    """Private parameters of `teleop_tf_node.py`: initial state of the teleoperation, and time-out of the signals."""

    input_timeout_s: SecondsOrOff = Field(
        0.5,
        description="Time after the last signal at which the frame stops; 0 means that a signal never expires.",
    )


class TeleopTf:
    """Moves a frame by `operator_node/signal`, and broadcasts the frame, while the teleoperation is switched on.

    While the teleoperation is off, the frame is broadcast only after resets, or always if `broadcast_always` is set.

    Raises:
        ConfigError: If `~config` or a parameter is wrong.
    """

    def __init__(self) -> None:
        with collecting_problems() as part:
            with part():
                self._config = private_config(TeleopConfig)
            with part():
                parameters = private_parameters(TeleopParameters)
        self._now = rospy.get_time if self._config.ros_time else time.monotonic
        self._teleop = Teleop(self._config, parameters.input_timeout_s)
        self._lock = threading.RLock()
        self._is_on = False
        self._broadcast_at: rospy.Time | None = None
        self._warn = ThrottledWarning()
        self._topic = TransformTopic(self._config.parent_frame_id, self._config.target_frame_id)
        teleop = Toggle("teleoperation", self._start, self._stop)
        if parameters.start_on_init:
            teleop.on()
        self._input = WatchedInput(
            "operator_node/signal", Float64MultiArray, self._on_signal, parameters.input_timeout_s
        )
        ToggleService("toggle_teleop_tf", teleop.on, teleop.off)
        rospy.Service("reset_teleop_transform", SetTransform, self._reset)
        rospy.Service("reset_teleop_transform_to_zero", Trigger, self._reset_to_zero)
        rospy.Service("teleop_box_limits", GetBoxLimits, self._limits)
        WallTimer(self._config.hz, self._step)

    def _start(self) -> None:
        with self._lock:
            self._is_on = True

    def _stop(self) -> None:
        with self._lock:
            self._teleop.stop()
            self._is_on = False

    def _on_signal(self, message: Float64MultiArray) -> None:
        with self._lock:
            if not self._is_on:
                return
            try:
                is_slowed = self._teleop.command(message.data, self._now())
            except ValueError as error:
                self._warn(self._input.topic, f"message refused, and the frame does not move: {error}")
                return
        if is_slowed:
            limits = f"max_speed {self._config.max_speed:g} m/s, max_turn_rate {self._config.max_turn_rate:g} rad/s"
            self._warn(f"{self._input.topic} too fast", f"the signal is reduced to {limits}")

    def _step(self) -> None:
        with self._lock:
            if not self._is_on:
                if self._config.broadcast_always:
                    self._broadcast_once_a_stamp()
                return
            if self._teleop.moves and self._input.has_ceased("the frame does not move"):
                self._teleop.stop()
            self._teleop.step(self._now())
            self._broadcast_once_a_stamp()

    def _broadcast_once_a_stamp(self) -> None:
        """Broadcasts the frame, unless it was already broadcast with the present stamp, which TF would warn about."""
        if rospy.Time.now() != self._broadcast_at:
            self._broadcast()

    def _broadcast(self) -> None:
        position, rpy = self._teleop.pose
        self._broadcast_at = self._topic.send(transform_message(position, rpy))

    def _reset(self, request: SetTransformRequest) -> SetTransformResponse:
        return SetTransformResponse(*self._put(request.transform))

    def _reset_to_zero(self, _: TriggerRequest) -> TriggerResponse:
        return TriggerResponse(*self._put(transform_message((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))))

    def _put(self, transform: Transform) -> tuple[bool, str]:
        try:
            x, y, z = position_in(transform).tolist()
            roll, pitch, yaw = rpy_of(quat_in(transform)).tolist()
            with self._lock:
                self._teleop.reset(TeleopPose((x, y, z), (roll, pitch, yaw)))
                if self._is_on or self._config.broadcast_always:  # a periodic broadcast follows if the stamp is not new
                    self._broadcast_once_a_stamp()
                else:
                    self._broadcast()
        except ValueError as error:
            return False, f"transform refused: {error}"
        return True, "transform set"

    def _limits(self, _: GetBoxLimitsRequest) -> GetBoxLimitsResponse:
        return GetBoxLimitsResponse(*map(list, self._config.box))


def main() -> None:
    """Runs the node."""
    run_node(NAME, TeleopTf)
