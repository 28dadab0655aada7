#!/usr/bin/python3
"""Writes schemas and reference pages; see rpbi.ros.reference.write."""

from rpbi.ros.reference.write import main

main()
