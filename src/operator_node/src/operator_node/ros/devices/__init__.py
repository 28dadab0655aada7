"""Nodes of input devices."""
