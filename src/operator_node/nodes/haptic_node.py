#!/usr/bin/python3
"""Joins a haptic device to a tool."""

from custom_ros_tools.ros.node import run

run("operator_node.ros.haptics.node:main")
