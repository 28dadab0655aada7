"""Checks of data sets: each fault is a sentence with file, episode and what was expected."""
