#!/usr/bin/python3
"""Has the KUKA push a box to and fro."""

from custom_ros_tools.ros.node import run

run("rpbi_examples.ros.push_example:main")
