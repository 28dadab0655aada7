"""How commands are found: rest, the nearest to a target, smooth ones, and what leads out of a margin."""
