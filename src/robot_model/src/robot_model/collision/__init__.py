"""Collision geometry: the shapes of a robot and of obstacles around it, and the distances between them."""
