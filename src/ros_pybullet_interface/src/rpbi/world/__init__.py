"""The world: its contents, their loading, and its step."""

from .world import World

__all__ = ["World"]
