#!/usr/bin/python3
"""Prints a robot description as ROS wants it, for the parameters of launch files."""

from rpbi.ros.robots.info import main

main()
