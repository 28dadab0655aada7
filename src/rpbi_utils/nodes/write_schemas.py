#!/usr/bin/python3
"""Writes the JSON Schemas of this package anew."""

from custom_ros_tools.ros.node import run_command

run_command("rpbi_utils.schemas:main")
