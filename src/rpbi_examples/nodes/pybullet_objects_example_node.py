#!/usr/bin/python3
"""Throws a box into the world again and again."""

from rpbi_examples.ros.pybullet_objects_example import main

main()
