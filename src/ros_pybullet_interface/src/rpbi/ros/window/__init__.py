"""PyBullet's window in ROS."""
