"""Chains of joints between two links, and the common part of their solvers."""
