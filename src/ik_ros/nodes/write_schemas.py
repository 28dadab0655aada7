#!/usr/bin/python3
"""Writes the JSON Schemas of solvers anew."""

from ik_ros.ros.write_schemas import main

main()
