#!/usr/bin/python3
"""Wipes a table."""

from custom_ros_tools.ros.node import run

run("rpbi_examples.ros.moving_robots:wiping_example")
