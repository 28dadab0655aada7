"""Shared by every package of the workspace; free of ROS outside `custom_ros_tools.ros`."""
