#!/usr/bin/python3
"""Pushes a box along a path by model predictive control."""

from custom_ros_tools.ros.node import run

run("rpbi_mpc.ros.pushing_node:main")
