#!/usr/bin/python3
"""Behaves as the driver of a Touch does."""

from custom_ros_tools.ros.node import run

run("operator_node.ros.haptics.touch_emulator:main")
