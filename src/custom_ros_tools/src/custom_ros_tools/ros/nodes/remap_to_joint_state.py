"""The nodes `remap_joint_state` and `remap_joint_state_to_joint_state`: joint states from one topic to another."""

from __future__ import annotations

from sensor_msgs.msg import JointState

from custom_ros_tools.node_configs import StartParameters
from custom_ros_tools.ros.joint_states import values_in
from custom_ros_tools.ros.lifecycle.parameters import private_parameters
from custom_ros_tools.ros.lifecycle.run_node import run_node

from .remap_node import RemapNode

NAME = "remap_joint_state_to_joint_state"


def main() -> None:
    """Runs the node."""
    run_node(NAME, _start)


def _start() -> RemapNode:
    start_on_init = private_parameters(StartParameters).start_on_init
    return RemapNode(NAME, "joint_states/from", "joint_states/to", JointState, _sound, start_on_init)


def _sound(message: JointState) -> JointState:
    """Returns the message as it is.

    Raises:
        ValueError: If it is faulty.
    """
    values_in(message)
    return message
