"""What a URDF says of a robot."""
