#!/usr/bin/python3
"""Records episodes on request; see docs/data.md."""

from custom_ros_tools.ros.node import run

run("episodes.ros.record:main")
