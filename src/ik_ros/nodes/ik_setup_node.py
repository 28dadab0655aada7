#!/usr/bin/python3
"""Publishes problems of inverse kinematics."""

from custom_ros_tools.ros.node import run

run("ik_ros.ros.setup_node:main")
