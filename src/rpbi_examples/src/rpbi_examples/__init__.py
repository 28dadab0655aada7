"""Worlds, robots, launch files and the short programs that go with them."""
