#!/usr/bin/python3
"""Moves an arm to its origin and switches teleoperation on and off, by keys."""

from custom_ros_tools.ros.node import run

run("rpbi_examples.ros.keyed_teleop:run_teleop")
