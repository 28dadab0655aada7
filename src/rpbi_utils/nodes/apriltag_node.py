#!/usr/bin/python3
"""Detects AprilTags in images."""

from custom_ros_tools.ros.node import run

run("rpbi_utils.ros.tracking.april_tags:main")
