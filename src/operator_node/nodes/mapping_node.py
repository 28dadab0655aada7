#!/usr/bin/python3
"""Maps a device by the mapping that the argument names."""

from custom_ros_tools.ros.node import run

run("operator_node.ros.mappings.mapping_node:main")
