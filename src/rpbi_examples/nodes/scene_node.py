#!/usr/bin/python3
"""Has a scene act in the simulator."""

from custom_ros_tools.ros.node import run

run("rpbi_examples.ros.scenes.node:main")
