"""Worlds as text and files: what they were built from, what entered them, and where they are."""
