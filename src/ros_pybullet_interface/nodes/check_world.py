#!/usr/bin/python3
"""Checks a world without a ROS master."""

from rpbi.ros.reference.check import main

main()
