#!/usr/bin/python3
"""Pushes parcels off the belt."""

from custom_ros_tools.program import run

run("my_robot_lab.ros.pusher:main")
