"""Mesh files: checks, and trial loading in a separate process."""
