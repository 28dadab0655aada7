#!/usr/bin/python3
"""Behaves as the service of a Haply Inverse3 does."""

from custom_ros_tools.ros.node import run_command

run_command("operator_node.emulators.haply:main")
