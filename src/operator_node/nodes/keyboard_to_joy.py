#!/usr/bin/python3
"""Makes axes and buttons of keys."""

from custom_ros_tools.ros.node import run

run("operator_node.ros.mappings.keyboard_to_joy:main")
