#!/usr/bin/python3
"""Moves a frame in a figure eight."""

from custom_ros_tools.ros.node import run

run("rpbi_examples.ros.moving_frames:figure_eight")
