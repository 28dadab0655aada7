#!/usr/bin/python3
"""Checks the targets of a robot before it is commanded to them."""

from custom_ros_tools.ros.node import run

run("safe_robot.ros.guard_node:main")
