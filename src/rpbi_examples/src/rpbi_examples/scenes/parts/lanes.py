"""Areas that a rectangular tool covers lane by lane."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from robot_model.geometry import Pose, Vector, rotated


class Stamp(NamedTuple):
    """Where a rectangular tool is on a plane.

    Attributes:
        x: Its middle [m].
        y: Its middle [m].
        yaw: Its turn [rad].
    """

    x: float
    y: float
    yaw: float

    @classmethod
    def of(cls, tool: Pose) -> Stamp:
        """Returns the stamp of a tool whose pose is in the frame of the plane."""
        x, y, _ = rotated(tool.quat_xyzw, (1.0, 0.0, 0.0))
        return cls(*tool.position[:2], math.atan2(y, x))


class Patch(NamedTuple):
    """The convex area between the points where a tool touches a plane.

    Attributes:
        edges: Outward normal and offset of each edge, shape (n, 3): inside, their product with (x, y, 1) is at most 0.
            Without any, nothing is inside.
    """

    edges: np.ndarray

    @classmethod
    def of(cls, plane: Pose, points: Iterable[Vector]) -> Patch:
        """Returns the patch of contact points in the world [m], in the frame of a plane; none if they have no area."""
        flat = [(plane.inverse() @ Pose(point)).position[:2] for point in points]
        try:
            return cls(ConvexHull(np.reshape(flat, (-1, 2))).equations)
        except (QhullError, ValueError):
            return cls(np.zeros((0, 3)))

    def covers(self, points: np.ndarray, margin: float = 0.0) -> np.ndarray:
        """Returns whether points of the plane are inside, as far as a margin from each edge [m].

        Args:
            points: Shape (..., 2) [m].
            margin: Least distance from each edge [m].

        Returns:
            Booleans, shape (...).
        """
        if not len(self.edges):
            return np.zeros(np.shape(points)[:-1], bool)
        depth = np.asarray(points) @ self.edges[:, :2].T + self.edges[:, 2]
        return np.asarray((depth <= -margin).all(axis=-1))


def lanes(count: int, length: float, pitch: float, step: float) -> np.ndarray:
    """Returns places along a path of parallel lanes that half circles join.

    Args:
        count: Number of lanes; they are parallel to y, and about the origin.
        length: Length of a lane [m].
        pitch: Distance between lanes [m].
        step: Distance between places [m], rounded to divide the path.

    Returns:
        Shape (n, 2) [m].
    """
    angles = np.linspace(0.0, np.pi, 30)
    turn = pitch / 2.0 * np.column_stack((1.0 - np.cos(angles), np.sin(angles)))
    lane = np.concatenate(([(0.0, -length / 2.0)], turn + (0.0, length / 2.0)))
    starts = pitch * (np.arange(count) - (count - 1) / 2.0)
    path = np.concatenate([lane * (1.0, (-1.0) ** number) + (x, 0.0) for number, x in enumerate(starts)])
    path = path[: 1 - len(turn)]  # the last lane ends without a turn
    ways = ways_along(path)
    at = np.linspace(0.0, ways[-1], round(ways[-1] / step) + 1)
    return np.column_stack([np.interp(at, ways, axis) for axis in path.T])


def middles(size: tuple[float, float], count: tuple[int, int]) -> np.ndarray:
    """Returns the middles of the cells of a rectangle about the origin.

    Args:
        size: Extents of the rectangle along x and y [m].
        count: Numbers of cells along x and y.

    Returns:
        Shape (*count, 2) [m].
    """
    indices = np.moveaxis(np.indices(count), 0, -1)
    return np.asarray(size * ((indices + 0.5) / count - 0.5))


def ways_along(places: Sequence[Sequence[float]] | np.ndarray) -> np.ndarray:
    """Returns the distance from the first place to each, along the path.

    Args:
        places: At least one; x and y [m] of each come first.

    Returns:
        Shape (n,) [m].
    """
    steps = np.linalg.norm(np.diff(np.array(places)[:, :2], axis=0), axis=1)
    return np.concatenate(([0.0], np.cumsum(steps)))


def share_of_way(places: Sequence[Sequence[float]], holds: Sequence[bool]) -> float:
    """Returns the share of the path along which a condition holds, from its value at the end of each step.

    Args:
        places: x and y [m] of each come first.
        holds: Whether the condition holds, for each place.
    """
    return float(np.average(holds[1:], weights=np.diff(ways_along(places)))) if len(places) > 1 else 0.0
