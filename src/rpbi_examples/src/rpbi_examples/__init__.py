"""Worlds, robots, launch files, and short programs that the launch files run."""
