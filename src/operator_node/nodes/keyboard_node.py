#!/usr/bin/python3
"""Publishes which keys are pressed."""

from custom_ros_tools.ros.node import run

run("operator_node.ros.devices.device_node:keyboard")
