"""Former import path of `robot_model.linear_algebra`, kept for controllers that import it."""

from robot_model.linear_algebra import inverse, solve

__all__ = ["inverse", "solve"]
