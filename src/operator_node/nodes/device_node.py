#!/usr/bin/python3
"""Publishes what an input device of another package says."""

from custom_ros_tools.ros.node import run

run("operator_node.ros.devices.device_node:main")
