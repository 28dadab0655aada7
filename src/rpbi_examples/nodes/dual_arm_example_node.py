#!/usr/bin/python3
"""Draws mirrored circles with two arms."""

from rpbi_examples.ros.dual_arm_example import main

main()
