"""The ROS node around the world."""
