"""What needs ROS to run."""
