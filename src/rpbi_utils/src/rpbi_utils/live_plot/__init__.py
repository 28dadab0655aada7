"""Numeric fields of running topics as lines over time, free of ROS and Qt."""
