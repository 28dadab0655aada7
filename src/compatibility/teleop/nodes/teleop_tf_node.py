#!/usr/bin/python3
"""Broadcasts a TF frame that a person moves."""

from custom_ros_tools.ros.node import run

run("operator_node.ros.teleop_tf:main")
