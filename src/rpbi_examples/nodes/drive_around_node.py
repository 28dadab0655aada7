#!/usr/bin/python3
"""Drives a mobile base along a route."""

from custom_ros_tools.ros.node import run

run("rpbi_examples.ros.moving_robots:drive_around")
