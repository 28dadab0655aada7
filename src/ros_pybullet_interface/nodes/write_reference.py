#!/usr/bin/python3
"""Writes schemas and reference pages; see rpbi.ros.write_reference."""

from rpbi.ros.write_reference import main

main()
