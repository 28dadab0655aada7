#!/usr/bin/python3
"""Writes the JSON Schemas of solvers anew."""

from custom_ros_tools.ros.node import run_command

run_command("ik_ros.schemas:main")
