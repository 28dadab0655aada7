"""Farm: makes many episodes at once, in each of which a policy acts in a simulated world."""

from .policy import Policy

__all__ = ["Policy"]
