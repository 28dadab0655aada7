#!/usr/bin/python3
"""Throws a box into the world again and again."""

from custom_ros_tools.ros.node import run

run("rpbi_examples.ros.pybullet_objects_example:main")
