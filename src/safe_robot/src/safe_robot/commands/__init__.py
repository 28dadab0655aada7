"""Search for commands: rest, the nearest to a target, smooth ones, and those that lead out of a margin."""
