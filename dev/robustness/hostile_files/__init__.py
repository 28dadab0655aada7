"""Broken and hostile files of all kinds, made by a seed, and their readers."""
