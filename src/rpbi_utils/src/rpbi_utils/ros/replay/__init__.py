"""The command that runs a recorded session again."""
