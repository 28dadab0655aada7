"""Folders of episodes that mean harm, and trials of their readers."""
