"""Topics, services and actions of the simulator in ROS 2, without an installation of ROS 2."""
