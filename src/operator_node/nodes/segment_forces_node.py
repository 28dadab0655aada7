#!/usr/bin/python3
"""Adds up the forces on each part of the avatar."""

from custom_ros_tools.ros.node import run

run("operator_node.ros.avatar.segment_forces:main")
