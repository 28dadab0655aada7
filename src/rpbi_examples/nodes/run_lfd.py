#!/usr/bin/python3
"""Learns from a person how to push a box, and repeats it."""

from custom_ros_tools.ros.node import run

run("rpbi_examples.ros.lfd.node:main")
