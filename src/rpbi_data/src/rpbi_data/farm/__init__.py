"""Episodes made by a policy in many worlds at once."""

from .policy import Policy

__all__ = ["Policy"]
