#!/usr/bin/python3
"""Prints a robot description as ROS wants it, for the parameters of launch files."""

from custom_ros_tools.ros.node import run_command

run_command("rpbi.ros.robots.info:main")
