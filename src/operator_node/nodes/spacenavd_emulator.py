#!/usr/bin/python3
"""Stands in for the driver of 6-D mice."""

from custom_ros_tools.ros.node import run_command

run_command("operator_node.emulators.spacenavd:main")
