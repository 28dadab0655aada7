#!/usr/bin/python3
"""Waves with the right hand of a human model."""

from custom_ros_tools.ros.node import run

run("rpbi_examples.ros.moving_robots:wave")
