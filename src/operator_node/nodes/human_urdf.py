#!/usr/bin/python3
"""Prints a person as URDF."""

from custom_ros_tools.ros.node import run_command

run_command("operator_node.ros.avatar.human_urdf:main")
