#!/usr/bin/python3
"""Moves an arm to the start of a figure eight, and has it track the figure."""

from custom_ros_tools.ros.node import run

run("rpbi_examples.ros.keyed_teleop:run_example")
