"""What stands in for hardware: the controller of a robot, with its limits and reflexes, without ROS."""
