"""Chains of joints between two links, and how solvers find their positions."""
