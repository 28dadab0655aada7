"""The window for the running world."""
