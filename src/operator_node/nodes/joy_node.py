#!/usr/bin/python3
"""Publishes what a joystick or gamepad says."""

from custom_ros_tools.ros.node import run

run("operator_node.ros.devices.device_node:joystick")
