"""The part that needs ROS."""
