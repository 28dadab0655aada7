#!/usr/bin/python3
"""Writes the JSON Schemas of solvers anew."""

from ik_ros.schemas import main

main()
