"""Examples: worlds, robots, launch files, and the short programs that launch files run."""
