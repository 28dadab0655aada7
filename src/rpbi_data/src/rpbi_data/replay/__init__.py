"""Recorded sessions in bags."""
