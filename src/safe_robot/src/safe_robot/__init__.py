"""The guard between targets and a robot: no target reaches the robot unchecked."""
