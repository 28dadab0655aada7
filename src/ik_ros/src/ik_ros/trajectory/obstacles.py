"""Distance between spheres on links and obstacles, for CasADi."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi
import numpy as np

from ik_ros.shape import ShapeConfig

from .forward_kinematics import rotation_matrix

SMALL = 1e-12
"""Keeps roots smooth at 0 [m^2]."""


class Obstacles:
    """Which spheres have to stay away from which shapes.

    Args:
        shapes: Spheres on links of the chain, and whatever stands in the base.
    """

    def __init__(self, shapes: Sequence[ShapeConfig]) -> None:
        self._spheres = [shape for shape in shapes if shape.link is not None]
        self._obstacles = [shape for shape in shapes if shape.link is None]

    @property
    def pairs(self) -> list[tuple[str, str]]:
        """Names of each sphere and obstacle."""
        return [(sphere.name, obstacle.name) for sphere in self._spheres for obstacle in self._obstacles]

    def distances(self, frames: dict[str, tuple[Any, Any]]) -> list[Any]:
        """Returns how far each pair is apart, negative in each other [m].

        Args:
            frames: Rotation and position of each link in the base.
        """
        distances = []
        for sphere in self._spheres:
            rotation, position = frames[str(sphere.link)]
            centre = position + rotation @ np.array(sphere.position)
            distances += [_distance(centre, obstacle) - sphere.core.radius for obstacle in self._obstacles]
        return distances


def _distance(point: Any, obstacle: ShapeConfig) -> Any:
    """Returns how far a point is from the surface of a shape."""
    half, radius = obstacle.core
    local = rotation_matrix(obstacle.pose).T @ (point - np.array(obstacle.position))
    if not obstacle.core.is_box:
        along = casadi.fmin(casadi.fmax(local[2], -half[2]), half[2])
        away = local - casadi.vertcat(0.0, 0.0, along)
        return casadi.sqrt(casadi.sumsqr(away) + SMALL) - radius
    over = casadi.fabs(local) - half
    outside = casadi.sqrt(casadi.sumsqr(casadi.fmax(over, 0.0)) + SMALL)
    return outside + casadi.fmin(casadi.mmax(over), 0.0)
