#!/usr/bin/python3
"""Presses keys as a person does who pushes a box."""

from custom_ros_tools.ros.node import run

run("rpbi_examples.ros.lfd.person_node:main")
