#!/usr/bin/python3
"""Has an avatar do what a person does."""

from custom_ros_tools.ros.node import run

run("operator_node.ros.avatar.avatar_node:main")
