"""Paths in parallel lanes over a plane, and the areas that a tool covers on the plane."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from robot_model.geometry import Pose, Vector, rotated


class Stamp(NamedTuple):
    """Pose of a tool on a plane, in the plane's frame.

    Attributes:
        x: x of the tool's middle [m].
        y: y of the tool's middle [m].
        yaw: Angle of the tool about the plane's normal [rad].
    """

    x: float
    y: float
    yaw: float

    @classmethod
    def of(cls, tool: Pose) -> Stamp:
        """Projects a tool's pose, given in the plane's frame, onto the plane."""
        x, y, _ = rotated(tool.quat_xyzw, (1.0, 0.0, 0.0))
        return cls(*tool.position[:2], math.atan2(y, x))


class Patch(NamedTuple):
    """The convex hull of the points at which a tool touches a plane.

    Attributes:
        edges: Outward normal and offset of each edge, shape (n, 3). A point is inside if the dot product of each row
            with (x, y, 1) is at most 0. Without edges, the patch is empty.
    """

    edges: np.ndarray

    @classmethod
    def of(cls, plane: Pose, points: Iterable[Vector]) -> Patch:
        """Computes the patch of contact points. The patch is empty if the points do not span an area.

        Args:
            plane: Pose of the plane's frame in the world.
            points: Positions of the contacts in the world [m].
        """
        flat = [(plane.inverse() @ Pose(point)).position[:2] for point in points]
        try:
            return cls(ConvexHull(np.reshape(flat, (-1, 2))).equations)
        except (QhullError, ValueError):
            return cls(np.zeros((0, 3)))

    def covers(self, points: np.ndarray, margin: float = 0.0) -> np.ndarray:
        """Returns which points of the plane are inside the patch.

        Args:
            points: x and y of the points in the plane's frame, shape (..., 2) [m].
            margin: Least distance of a point from each edge [m].

        Returns:
            Booleans, shape (...).
        """
        if not len(self.edges):
            return np.zeros(np.shape(points)[:-1], bool)
        depth = np.asarray(points) @ self.edges[:, :2].T + self.edges[:, 2]
        return np.asarray((depth <= -margin).all(axis=-1))


def lanes(count: int, length: float, pitch: float, step: float) -> np.ndarray:
    """Returns points along a path of parallel lanes. Half circles join the lanes.

    The lanes are parallel to y, and the path is centred at the origin.

    Args:
        count: Number of lanes.
        length: Length of each lane [m].
        pitch: Distance between neighbouring lanes [m].
        step: Approximate distance between points [m]; the exact distance divides the path evenly.

    Returns:
        x and y of the points, shape (n, 2) [m].
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
    """Divides a rectangle around the origin into cells, and returns the middles of the cells.

    Args:
        size: Extents of the rectangle along x and y [m].
        count: Numbers of cells along x and y.

    Returns:
        x and y of each middle, shape (*count, 2) [m].
    """
    indices = np.moveaxis(np.indices(count), 0, -1)
    return np.asarray(size * ((indices + 0.5) / count - 0.5))


def ways_along(places: Sequence[Sequence[float]] | np.ndarray) -> np.ndarray:
    """Returns the distance along a path from the first point to each point.

    Args:
        places: The n points of the path, at least one. The first two values of each point are x and y [m].

    Returns:
        Distances, shape (n,) [m].
    """
    steps = np.linalg.norm(np.diff(np.array(places)[:, :2], axis=0), axis=1)
    return np.concatenate(([0.0], np.cumsum(steps)))


def share_of_way(places: Sequence[Sequence[float]], holds: Sequence[bool]) -> float:
    """Returns the share of a path's length along which a condition holds.

    A segment counts if the condition holds at the segment's last point.

    Args:
        places: Points of the path. The first two values of each point are x and y [m].
        holds: Whether the condition holds at each point.
    """
    return float(np.average(holds[1:], weights=np.diff(ways_along(places)))) if len(places) > 1 else 0.0
