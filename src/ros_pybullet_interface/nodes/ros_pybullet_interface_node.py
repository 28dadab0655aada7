#!/usr/bin/python3
"""Runs the simulator node."""

from custom_ros_tools.ros.node import run

run("rpbi.ros.node:main")
