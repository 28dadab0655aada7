#!/usr/bin/python3
"""Sends an arm's tip through three coloured points."""

from custom_ros_tools.ros.node import run

run("rpbi_examples.ros.run_interpolation:main")
