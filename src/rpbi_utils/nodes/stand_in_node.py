#!/usr/bin/python3
"""Plays the controller of a robot, with its limits and reflexes, for a robot in a simulator."""

from custom_ros_tools.ros.node import run

run("rpbi_utils.ros.fake_driver.node:main")
