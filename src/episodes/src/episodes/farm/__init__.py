"""Episodes that a policy makes in many worlds at once."""

from .policy import Policy

__all__ = ["Policy"]
