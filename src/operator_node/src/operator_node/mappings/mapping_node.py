"""Nodes that apply a mapping: `scale_node.py`, `isometric_node.py` and `mapping_node.py MAPPING`."""

import sys

import rospy
from sensor_msgs.msg import Joy

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.lifecycle.run_node import run_node

from . import MAPPINGS
from .operator_node import NAME, OperatorNode


class MappingNode(OperatorNode):
    """Publishes the signal that a mapping computes from the axes of the messages on `joy`.

    Args:
        name: Name of a mapping in the table `MAPPINGS`, or `"their_package.module:Class"`.

    Raises:
        UnknownNameError: If the mapping is unknown.
        ConfigError: If the mapping's options, `~config`, are wrong.
    """

    def __init__(self, name: str) -> None:
        self._mapping = MAPPINGS.make(name, rospy.get_param("~config", {}), "~config")
        super().__init__()

    def callback(self, joy: Joy) -> None:
        """Applies the mapping to a message and publishes the signal."""
        self.publish(self._mapping.map(joy.axes))


def scale() -> None:
    """Runs the node with the mapping `scale`."""
    run_node(NAME, lambda: MappingNode("scale"))


def isometric() -> None:
    """Runs the node with the mapping `isometric`."""
    run_node(NAME, lambda: MappingNode("isometric"))


def main() -> None:
    """Runs the node with the mapping that the program's argument names."""

    def make() -> MappingNode:
        arguments = rospy.myargv(sys.argv)[1:]
        if len(arguments) != 1:
            raise InterfaceError(f"expected the name of a mapping, got {len(arguments)} arguments")
        return MappingNode(arguments[0])

    run_node(NAME, make)
