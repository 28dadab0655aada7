"""Episodes in ROS: the recorder, repairs, tables and verification."""
