#!/usr/bin/python3
"""Publishes a wrench less its offset and less the weight of a payload."""

from custom_ros_tools.ros.node import run

run("rpbi_utils.ros.wrenches:main")
