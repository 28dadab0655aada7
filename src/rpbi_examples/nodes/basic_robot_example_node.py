#!/usr/bin/python3
"""Moves the joints of a robot one after the other."""

from custom_ros_tools.ros.node import run

run("rpbi_examples.ros.moving_robots:basic_robot_example")
