#!/usr/bin/python3
"""Streams a person who walks and reaches, as MVN does."""

from custom_ros_tools.ros.node import run_command

run_command("operator_node.emulators.mvn_suit:main")
