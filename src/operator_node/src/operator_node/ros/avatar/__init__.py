"""The nodes of the avatar."""
