#!/usr/bin/python3
"""Publishes a transform as numbers."""

from custom_ros_tools.ros.node import run

run("ik_ros.ros.tf_to_float_array:main")
