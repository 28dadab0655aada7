#!/usr/bin/python3
"""Opens a window with buttons for a running simulator."""

from custom_ros_tools.ros.node import run

run("rpbi_utils.ros.controls.node:main")
