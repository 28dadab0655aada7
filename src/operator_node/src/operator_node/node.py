"""Public import path of `OperatorNode`, from which users derive nodes that map a device to signals."""

from operator_node.mappings.operator_node import OperatorNode, main

__all__ = ["OperatorNode", "main"]
