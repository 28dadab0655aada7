#!/usr/bin/python3
"""Sends a recorded stream of MVN again."""

from custom_ros_tools.ros.node import run_command

run_command("operator_node.mvn.player:main")
