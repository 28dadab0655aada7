"""The guard's node."""
