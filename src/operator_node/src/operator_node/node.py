"""Public import path of the node that maps a device; users derive from it."""

from operator_node.mappings.operator_node import OperatorNode, main

__all__ = ["OperatorNode", "main"]
