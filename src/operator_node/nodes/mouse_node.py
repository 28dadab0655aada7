#!/usr/bin/python3
"""Publishes how a mouse is dragged."""

from custom_ros_tools.ros.node import run

run("operator_node.ros.devices.device_node:mouse")
