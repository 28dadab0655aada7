#!/usr/bin/python3
"""Solves problems of inverse kinematics."""

from custom_ros_tools.ros.node import run

run("ik_ros.ros.solver_node:main")
