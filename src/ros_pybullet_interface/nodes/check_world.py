#!/usr/bin/python3
"""Finds all problems of a world; see `check_world.py --help`."""

from custom_ros_tools.ros.console import run_console

run_console("rpbi.ros.console.check")
