"""The farm, which makes many episodes at the same time. In each episode, a policy acts in a simulated world."""

from .policy import Policy

__all__ = ["Policy"]
