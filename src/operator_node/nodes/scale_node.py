#!/usr/bin/python3
"""Maps a device axis by axis."""

from custom_ros_tools.ros.node import run

run("operator_node.ros.mappings.mapping_node:scale")
