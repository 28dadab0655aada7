#!/usr/bin/python3
"""Runs an example."""

from custom_ros_tools.ros.node import run_command

run_command("rpbi_examples.ros.launch:main")
