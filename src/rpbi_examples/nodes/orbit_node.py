#!/usr/bin/python3
"""Moves the camera's frame around the scene."""

from custom_ros_tools.ros.node import run

run("rpbi_examples.ros.moving_frames:orbit")
