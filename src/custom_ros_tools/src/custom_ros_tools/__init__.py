"""What every package of the workspace shares; free of ROS outside `custom_ros_tools.ros`."""
