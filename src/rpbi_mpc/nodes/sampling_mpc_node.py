#!/usr/bin/python3
"""Commands a robot by the best of its predicted futures."""

from custom_ros_tools.ros.node import run

run("rpbi_mpc.ros.sampling_node:main")
