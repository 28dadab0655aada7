#!/usr/bin/python3
"""Draws mirrored circles with two arms."""

from custom_ros_tools.ros.node import run

run("rpbi_examples.ros.moving_robots:dual_arm_example")
