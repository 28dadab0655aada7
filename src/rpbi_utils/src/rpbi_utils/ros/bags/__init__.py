"""Bags and ROS: recording, reading, tables, and reports on topics."""
