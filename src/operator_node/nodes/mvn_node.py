#!/usr/bin/python3
"""Publishes the people whom MVN streams."""

from custom_ros_tools.ros.node import run

run("operator_node.ros.devices.device_node:mvn")
