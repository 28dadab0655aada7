"""Input devices, mappings, force feedback, motion capture and teleoperation."""
