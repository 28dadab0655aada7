"""Scenes in the simulator of a ROS master."""
