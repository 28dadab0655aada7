#!/usr/bin/python3
"""Moves a frame in a figure eight."""

from rpbi_examples.ros.figure_eight import main

main()
