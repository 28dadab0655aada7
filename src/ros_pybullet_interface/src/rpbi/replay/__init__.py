"""Recorded sessions, run again."""
