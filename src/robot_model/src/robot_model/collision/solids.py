"""Solids, which are convex hulls of a few balls. Each solid contains a collision shape."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from robot_model.geometry import Vector

MESH_MARGIN_M = 1e-3
"""Thickness that PyBullet adds to convex meshes [m]."""
COARSE_M = 2e-3
"""Corners of a mesh are kept until each other corner is at most this far from a line between two kept corners [m].
The remaining distance is added to the radius of the balls."""
BLOCK = 4096
"""Number of corners whose distances are computed at once, which limits the memory for large meshes."""
MAX_CORNERS = 48
"""Largest number of kept corners of a mesh, even if other corners are then further away than `COARSE_M`."""
SIDES = 32
"""Number of sides of the prism around a cylinder."""
CUBE = 2.0 * ((np.arange(8)[:, None] >> np.arange(3)) & 1) - 1.0
"""The 8 corners of a cube from -1 to 1, 8 x 3."""


class ClosestPoints(NamedTuple):
    """The points at which two shapes are nearest to each other, in the robot's root frame.

    Attributes:
        distance: Distance between the surfaces; negative if the shapes penetrate each other [m].
        direction: Unit vector along the line between the two points; its sign is arbitrary.
        first: The point on the first shape [m].
        second: The point on the second shape [m].
    """

    distance: float
    direction: Vector
    first: Vector
    second: Vector


class Solid(NamedTuple):
    """The convex hull of balls, or a half-space, which moves with a frame.

    Attributes:
        frame: Number of the frame, see `LinkFrames`.
        balls: v balls, v x 4: centre x, y and z in the frame, and radius [m].
        normal: Outward normal of a half-space whose boundary contains the first ball's centre. None for a convex hull.
    """

    frame: int
    balls: np.ndarray
    normal: np.ndarray | None = None

    @property
    def extent(self) -> tuple[np.ndarray, np.ndarray]:
        """Smallest and largest x, y and z of the solid [m]; inf and -inf for a solid without balls."""
        places, radius = self.balls[:, :3], self.balls[:, 3:]
        return (places - radius).min(axis=0, initial=np.inf), (places + radius).max(axis=0, initial=-np.inf)

    def moved(self, frame: int, pose: np.ndarray) -> "Solid":
        """Returns the solid expressed in another frame.

        Args:
            frame: Number of the other frame.
            pose: Pose of the solid's current frame in the other frame, 4 x 4.
        """
        turn, shift = pose[:3, :3], pose[:3, 3]
        balls = np.column_stack((self.balls[:, :3] @ turn.T + shift, self.balls[:, 3]))
        return Solid(frame, balls, None if self.normal is None else turn @ self.normal)

    def grown(self, by_m: float) -> "Solid":
        """Returns the solid with the radius of each ball increased by `by_m` [m]."""
        return self._replace(balls=self.balls + (0.0, 0.0, 0.0, by_m))


def extent_of(solids: Sequence[Solid]) -> tuple[np.ndarray, np.ndarray]:
    """Returns the smallest and largest x, y and z of solids that are all expressed in the same frame [m]."""
    return Solid(0, np.concatenate([solid.balls for solid in solids] or [np.empty((0, 4))])).extent


def box_of(lower: np.ndarray, upper: np.ndarray) -> Solid:
    """Returns the box from the corner `lower` to the corner `upper` [m].

    If `lower` exceeds `upper`, the solid has one ball whose numbers are NaN.
    """
    if (lower > upper).any():
        return Solid(0, np.full((1, 4), np.nan))
    corners = (lower + upper) / 2.0 + CUBE * (upper - lower) / 2.0
    return Solid(0, np.column_stack((corners, np.zeros(8))))


def balls_of(kind: str, size: tuple[float, ...]) -> np.ndarray:
    """Returns v balls whose convex hull contains a box, sphere, capsule or cylinder, v x 4; 0 x 4 for other kinds.

    For `size`, see `CollisionShape`. Boxes, spheres and capsules are exact; a cylinder is enclosed in a prism.
    """
    if kind == "box":
        half = np.array(size) / 2.0
        return box_of(-half, half).balls
    if kind == "sphere":
        return np.array(((0.0, 0.0, 0.0, size[0]),))
    if kind == "capsule":
        return np.array([(0.0, 0.0, z * size[0] / 2.0, size[1]) for z in (-1.0, 1.0)])
    if kind == "cylinder":
        angles = 2.0 * math.pi / SIDES * np.arange(SIDES)
        x, y = size[1] / math.cos(math.pi / SIDES) * np.array((np.cos(angles), np.sin(angles)))
        ends = [np.column_stack((x, y, np.full(SIDES, z), np.zeros(SIDES))) for z in (-size[0] / 2.0, size[0] / 2.0)]
        return np.concatenate(ends)
    return np.empty((0, 4))


def few_balls(points: Sequence[Vector]) -> np.ndarray:
    """Selects v corners of a mesh, and returns balls at these corners whose convex hull contains the mesh, v x 4.

    Corners are selected one after the other. The next corner is the one that is furthest from all line segments between
    the corners selected so far.
    """
    if not points:
        return np.empty((0, 4))
    corners = np.array(points)
    try:
        corners = corners[ConvexHull(corners).vertices]
    except QhullError:  # a flat mesh
        corners = np.unique(corners, axis=0)
    kept = [int(np.argmax(np.linalg.norm(corners - corners.mean(axis=0), axis=1)))]
    away = np.linalg.norm(corners - corners[kept[0]], axis=1)
    while away.max() > COARSE_M and len(kept) < MAX_CORNERS:
        new = int(np.argmax(away))
        for first in range(0, len(corners), BLOCK):
            block = slice(first, first + BLOCK)
            away[block] = np.minimum(away[block], _from_lines(corners[block], corners[kept], corners[new]))
        kept.append(new)
    return np.column_stack((corners[kept], np.full(len(kept), away.max() + MESH_MARGIN_M)))


def _from_lines(points: np.ndarray, starts: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Returns the distance of each of v points from the nearest of the line segments from k `starts` to `end`."""
    lines = end - starts
    offsets = points - starts[:, None]
    shares = np.einsum("kvi,ki->kv", offsets, lines) / np.einsum("ki,ki->k", lines, lines)[:, None]
    offsets -= np.clip(shares, 0.0, 1.0)[..., None] * lines[:, None]
    distances: np.ndarray = np.linalg.norm(offsets, axis=2).min(axis=0)
    return distances
