#!/usr/bin/python3
"""Moves the joints of a robot one after the other."""

from rpbi_examples.ros.basic_robot_example import main

main()
