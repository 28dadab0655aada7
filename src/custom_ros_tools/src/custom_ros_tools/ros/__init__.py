"""Modules that need ROS."""
