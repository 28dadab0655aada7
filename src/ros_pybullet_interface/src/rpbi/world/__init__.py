"""Simulated worlds: configuration, loading, simulation, saved states and predictions."""

from .world import World

__all__ = ["World"]
