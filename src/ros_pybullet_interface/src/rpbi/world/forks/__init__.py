"""Forks of a world: processes in which it continues independently."""
