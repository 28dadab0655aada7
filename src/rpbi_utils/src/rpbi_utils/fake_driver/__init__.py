"""Emulated driver of a robot: its controller, with limits and reflexes, without ROS."""
