"""What robots have in ROS beside their samples."""
