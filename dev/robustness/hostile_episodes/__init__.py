"""Hostile folders of episodes, and trials of their readers."""
