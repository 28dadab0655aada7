#!/usr/bin/python3
"""Maps a device so that it is equally fast in all directions."""

from custom_ros_tools.ros.node import run

run("operator_node.ros.mappings.mapping_node:isometric")
