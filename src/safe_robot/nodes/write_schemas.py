#!/usr/bin/python3
"""Writes the JSON Schema of a guard's parameters anew."""

from custom_ros_tools.ros.node import run_command

run_command("safe_robot.schemas:main")
