"""A node that maps a device in a way of its own."""

from operator_node.ros.mappings.operator_node import OperatorNode, main

__all__ = ["OperatorNode", "main"]
