"""Nodes that forward joint states to another topic, as joint states or arrays, with the names and units of a driver."""

from collections.abc import Callable
from typing import Any, TypeVar

import rospy
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from custom_ros_tools.errors import InterfaceError, collecting_problems
from custom_ros_tools.joint_values import JointValues
from custom_ros_tools.node_configs import FloatArrayConfig, RemapConfig, StartParameters
from custom_ros_tools.ros.lifecycle.parameters import private_config, private_parameters
from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning

from .joint_states import joint_state, values_in
from .services import Toggle, ToggleService

Config = TypeVar("Config", bound=RemapConfig)

TO_FLOAT_ARRAY = "remap_joint_state_to_floatarray"
TO_JOINT_STATE = "remap_joint_state_to_joint_state"
QUEUE_SIZE = 1000
"""Queue size of publisher and subscriber, enough for 1 s of joint states at 1 kHz on a busy machine."""
START_WAIT_S = 2.0
"""Longest time to wait for a command and for a state of the robot, each, when the node is switched on [s]."""


class RemapNode:
    """Converts and publishes joint states while it is switched on. While it is off, it does not subscribe.

    The services `remap_joint_state/toggle` and `EXECUTABLE/toggle` switch the node on and off.

    Args:
        executable: Name of the executable.
        source: Topic of the joint states to convert.
        target: Topic of the converted messages.
        target_type: Type of the converted messages.
        convert: Function that converts a joint state to a message. To refuse the joint state, it raises an
            InterfaceError or a ValueError.
        config: The configuration, which may have a condition for switching on.
        start_on_init: Whether the node is on initially.
    """

    def __init__(
        self,
        executable: str,
        source: str,
        target: str,
        target_type: type,
        convert: Callable[[JointState], Any],
        config: RemapConfig,
        start_on_init: bool,
    ) -> None:
        self._source, self._convert, self._config = rospy.resolve_name(source), convert, config
        self._warn = ThrottledWarning()
        self._publisher = rospy.Publisher(target, target_type, queue_size=QUEUE_SIZE, tcp_nodelay=True)
        self._subscriber: rospy.Subscriber | None = None
        self._remapping = Toggle("remapping", self._listen, self._listen_no_more)
        if start_on_init:
            is_on, message = self._switch_on()
            if not is_on:
                rospy.logwarn(message)
        for name in {"remap_joint_state/toggle", f"{executable}/toggle"}:
            ToggleService(name, self._switch_on, self._remapping.off)

    def _switch_on(self) -> tuple[bool, str]:
        try:
            return self._remapping.on()
        except (InterfaceError, ValueError) as error:
            return False, f"remapping stays off: {error}"

    def _listen(self) -> None:
        if self._config.start_within is not None:
            _check_start(self._config, self._source)
        self._subscriber = rospy.Subscriber(
            self._source, JointState, self._on_message, queue_size=QUEUE_SIZE, tcp_nodelay=True
        )

    def _listen_no_more(self) -> None:
        if self._subscriber is not None:
            self._subscriber.unregister()

    def _on_message(self, message: JointState) -> None:
        try:
            converted = self._convert(message)
        except (InterfaceError, ValueError) as error:
            self._warn(self._source, f"message refused: {error}")
            return
        self._publisher.publish(converted)


def _check_start(config: RemapConfig, source: str) -> None:
    """Waits for a command and for a measured state of the robot, and checks that both are near each other.

    Args:
        config: The configuration, with `start_within`.
        source: Topic of the commands.

    Raises:
        InterfaceError: If a joint's command and state are too far apart, or if a message lacks joints or does not
            arrive.
        ValueError: If a message is invalid.
    """
    assert config.start_within is not None
    measured = _one_state(config.start_within.topic).converted([each.inverse() for each in config.conversions()])
    joints = measured.names if config.joint_names is None else config.joint_names
    wanted, is_at = (values.in_order(joints).position for values in (_one_state(source), measured))
    tolerance = config.start_within.tolerance
    for joint, goal, position in zip(joints, wanted, is_at, strict=True):
        if abs(goal - position) > tolerance:
            where = f"joint '{joint}' of the robot is at {position:.4g} and would be commanded to {goal:.4g}"
            raise InterfaceError(f"{where}: expected them within {tolerance:g}")


def _one_state(topic: str) -> JointValues:
    try:
        return values_in(rospy.wait_for_message(topic, JointState, START_WAIT_S))
    except rospy.ROSException:
        name = rospy.resolve_name(topic)
        raise InterfaceError(f"no joint states came on {name} within {START_WAIT_S:g} s") from None


def _float_array_node() -> RemapNode:
    """Makes the node that publishes one quantity of joint states as an array of numbers, with options in `~config`.

    Raises:
        ConfigError: If the configuration or a parameter is invalid.
    """
    config, start_on_init = _parameters(FloatArrayConfig)
    conversions = config.conversions()

    def numbers(message: JointState) -> Float64MultiArray:
        values = JointValues.of(message.name, **{config.field: getattr(message, config.field)})
        if config.joint_names is not None:
            values = values.in_order(config.joint_names)
        data = list(getattr(values.converted(conversions), config.field))
        if not data:
            raise ValueError(f"expected {config.field}, got none")
        return Float64MultiArray(data=data)

    topics = "joint_states", "joint_states/floatarray"
    return RemapNode(TO_FLOAT_ARRAY, *topics, Float64MultiArray, numbers, config, start_on_init)


def _joint_state_node() -> RemapNode:
    """Makes the node that publishes joint states on another topic, with joint names and units from `~config`.

    Raises:
        ConfigError: If the configuration or a parameter is invalid.
    """
    config, start_on_init = _parameters(RemapConfig)
    conversions = config.conversions()

    def remapped(message: JointState) -> JointState:
        values = values_in(message)
        if config.joint_names is None and not conversions:
            return message
        if config.joint_names is not None:
            values = values.in_order(config.joint_names)
        return joint_state(values.converted(conversions), message.header)

    topics = "joint_states/from", "joint_states/to"
    return RemapNode(TO_JOINT_STATE, *topics, JointState, remapped, config, start_on_init)


def _parameters(model: type[Config]) -> tuple[Config, bool]:
    """Reads `~config`, and the parameter that says whether the node is on initially."""
    with collecting_problems() as part:
        with part():
            config = private_config(model)
        with part():
            start_on_init = private_parameters(StartParameters).start_on_init
    return config, start_on_init


def remap_to_float_array() -> None:
    """Runs the node `remap_joint_state_to_floatarray`."""
    run_node(TO_FLOAT_ARRAY, _float_array_node)


def remap_to_joint_state() -> None:
    """Runs the nodes `remap_joint_state` and `remap_joint_state_to_joint_state`."""
    run_node(TO_JOINT_STATE, _joint_state_node)
