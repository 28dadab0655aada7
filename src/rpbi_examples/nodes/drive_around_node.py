#!/usr/bin/python3
"""Drives a mobile base along a route."""

from rpbi_examples.ros.drive_around import main

main()
