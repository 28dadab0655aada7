#!/usr/bin/python3
"""Runs the demo."""

from custom_ros_tools.ros.console import run_console

run_console("rpbi_examples.ros.console.demo")
