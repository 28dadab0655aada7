"""Keyframes: states of a world from which it continues without former commands."""
