#!/usr/bin/python3
"""Broadcasts a TF frame that is dragged in RViz; the node is one of operator_node."""

from custom_ros_tools.ros.node import run

run("operator_node.ros.interactive_target:main")
