"""Keyframes: states of a world from which it goes on without what was before."""
