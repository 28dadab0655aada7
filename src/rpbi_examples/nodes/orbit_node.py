#!/usr/bin/python3
"""Moves the camera's frame around the scene."""

from rpbi_examples.ros.orbit import main

main()
