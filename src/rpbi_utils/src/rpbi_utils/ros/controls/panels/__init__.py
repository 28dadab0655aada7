"""The parts of the controls window."""
