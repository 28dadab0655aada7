#!/usr/bin/python3
"""Draws mirrored circles with two arms."""

from custom_ros_tools.ros.node import run

run("rpbi_examples.ros.dual_arm_example:main")
