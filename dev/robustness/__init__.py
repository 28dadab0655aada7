"""Hostile files by structure and by bytes, their readers, and the results."""
