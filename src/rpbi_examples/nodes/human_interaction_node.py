#!/usr/bin/python3
"""Watches a person press an arm on a box."""

from custom_ros_tools.ros.node import run

run("rpbi_examples.ros.human_interaction:main")
