"""Nodes around tracking systems."""
