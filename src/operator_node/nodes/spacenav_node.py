#!/usr/bin/python3
"""Publishes how a 6-D mouse is moved."""

from custom_ros_tools.ros.node import run

run("operator_node.ros.devices.device_node:spacenav")
