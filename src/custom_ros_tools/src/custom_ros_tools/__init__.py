"""Code that all packages of the workspace share. Only modules in `custom_ros_tools.ros` import ROS."""
