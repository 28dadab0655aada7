"""The parts of `rpbi_utils` that use ROS."""
