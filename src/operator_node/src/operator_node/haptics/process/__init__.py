"""The process that the haptic loop has for itself, and the link between it and the node."""
