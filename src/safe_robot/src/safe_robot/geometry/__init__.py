"""Shapes of the robot and of what is around it, and how far they are apart."""
