"""Scenes that act in the simulator of a ROS master."""
