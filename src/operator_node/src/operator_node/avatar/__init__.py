"""A person in the simulator: their body as URDF, and how it follows a motion capture suit."""
