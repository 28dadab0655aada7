"""A simulated world: its contents, how they are loaded, and its step."""

from .world import World

__all__ = ["World"]
