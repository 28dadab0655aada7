#!/usr/bin/python3
"""Learns movement primitives, plans with them and executes them."""

from custom_ros_tools.ros.node import run

run("motion_primitives.ros.primitives_node:main")
