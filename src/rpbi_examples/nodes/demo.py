#!/usr/bin/python3
"""Runs the demo."""

from rpbi_examples.ros.demo import main

main()
