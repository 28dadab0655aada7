#!/usr/bin/python3
"""Moves a TF frame or joints smoothly through waypoints."""

from custom_ros_tools.ros.node import run

run("rpbi_utils.ros.interpolation:main")
