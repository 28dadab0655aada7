"""Lifecycle of a node: start, interrupts, log, the master, end."""
