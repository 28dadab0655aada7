#!/usr/bin/python3
"""Runs the demo."""

from custom_ros_tools.ros.node import run_command

run_command("rpbi_examples.ros.demo:main")
