"""The process of the haptic loop, and the link between it and the node."""
