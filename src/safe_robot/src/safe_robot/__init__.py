"""Guard between targets and a robot: checks each target before it reaches the robot."""
