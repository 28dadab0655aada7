"""Numeric fields of running topics as lines over time, without ROS and Qt."""
