"""Demonstrations as episodes: recorded, listed, read as one table, and verified."""
