#!/usr/bin/python3
"""Has an arm track a figure eight by inverse kinematics."""

from custom_ros_tools.ros.node import run

run("rpbi_examples.ros.ik_example:main")
