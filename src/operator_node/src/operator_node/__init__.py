"""People in the world: input devices, mappings, force feedback, motion capture, teleoperation."""
