#!/usr/bin/python3
"""Checks a world without a ROS master."""

from custom_ros_tools.ros.node import run_command

run_command("rpbi.ros.reference.check:main")
