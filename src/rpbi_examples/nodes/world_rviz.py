#!/usr/bin/python3
"""RViz with displays for the contact forces and camera images of a world."""

from rpbi_examples.ros.world_rviz import main

main()
