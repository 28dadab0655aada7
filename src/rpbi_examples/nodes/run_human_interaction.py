#!/usr/bin/python3
"""A Touch X moves an arm up and down and renders its force, by the names of the authors' release."""

from custom_ros_tools.ros.node import run

run("rpbi_examples.ros.touch_x_example:main")
