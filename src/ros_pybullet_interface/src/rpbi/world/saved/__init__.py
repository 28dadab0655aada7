"""Saved worlds as text and files: descriptions, commands and states."""
