#!/usr/bin/python3
"""Writes schemas and reference pages; see rpbi.ros.reference.write."""

from custom_ros_tools.ros.node import run_command

run_command("rpbi.ros.reference.write:main")
