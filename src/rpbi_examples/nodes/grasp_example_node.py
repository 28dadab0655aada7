#!/usr/bin/python3
"""Lifts, carries and places a box."""

from custom_ros_tools.ros.node import run

run("rpbi_examples.ros.grasp_example:main")
