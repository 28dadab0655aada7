#!/usr/bin/python3
"""Draws a sleeve over the arm of a person."""

from custom_ros_tools.ros.node import run

run("rpbi_examples.ros.telepresence:main")
