"""What the simulator is asked for: services of the node and of each body."""
