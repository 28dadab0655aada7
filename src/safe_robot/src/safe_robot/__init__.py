"""Guard that checks each joint target before the robot receives the target."""
