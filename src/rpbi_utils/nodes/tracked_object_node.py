#!/usr/bin/python3
"""Broadcasts what Vicon or an AprilTag detector sees as smooth TF frames."""

from custom_ros_tools.ros.node import run

run("rpbi_utils.ros.tracking.tracked_object:main")
