"""A person in the simulator: the body as URDF, and its motion from a motion capture suit."""
