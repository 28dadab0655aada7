"""The node `remap_joint_state_to_floatarray`: joint states as bare numbers, for drivers that take those."""

from __future__ import annotations

from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from custom_ros_tools.errors import collecting_problems
from custom_ros_tools.joint_values import JointValues
from custom_ros_tools.node_configs import FloatArrayConfig, StartParameters
from custom_ros_tools.ros.lifecycle.parameters import private_config, private_parameters
from custom_ros_tools.ros.lifecycle.run_node import run_node

from .remap_node import RemapNode

NAME = "remap_joint_state_to_floatarray"


class FloatArrayNode(RemapNode):
    """Publishes one quantity of joint states as numbers, in the order of `~config`.

    Raises:
        ConfigError: If the configuration or a parameter is wrong.
    """

    def __init__(self) -> None:
        with collecting_problems() as part:
            with part():
                self._config = private_config(FloatArrayConfig)
            with part():
                start = private_parameters(StartParameters)
        topics = "joint_states", "joint_states/floatarray"
        super().__init__(NAME, *topics, Float64MultiArray, self._numbers, start.start_on_init)

    def _numbers(self, message: JointState) -> Float64MultiArray:
        field = self._config.field
        values = JointValues.of(message.name, **{field: getattr(message, field)})
        if self._config.joint_names is not None:
            values = values.in_order(self._config.joint_names)
        numbers = getattr(values, field)
        if not numbers:
            raise ValueError(f"expected {field}, got none")
        return Float64MultiArray(data=list(numbers))


def main() -> None:
    """Runs the node."""
    run_node(NAME, FloatArrayNode)
