#!/usr/bin/python3
"""Broadcasts a TF frame that is dragged in RViz."""

from custom_ros_tools.ros.node import run

run("operator_node.ros.interactive_target:main")
