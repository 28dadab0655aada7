"""Former place of `robot_model.linear_algebra`, for controllers that import it from here."""

from robot_model.linear_algebra import inverse, solve

__all__ = ["inverse", "solve"]
