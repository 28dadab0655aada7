#!/usr/bin/python3
"""Dresses people of chance, without ROS."""

from custom_ros_tools.ros.node import run_command

run_command("rpbi_examples.dressing.trial:main")
