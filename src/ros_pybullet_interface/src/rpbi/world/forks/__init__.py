"""Forks of a world: processes in which it goes on another way."""
