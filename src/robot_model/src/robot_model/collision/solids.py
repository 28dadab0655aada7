"""Convex hulls of a few balls that contain collision shapes."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from robot_model.geometry import Vector

MESH_MARGIN_M = 1e-3
"""Thickness that PyBullet adds to convex meshes [m]."""
COARSE_M = 2e-3
"""Largest distance of a dropped corner from the hull of the kept ones [m]; the balls are larger by the actual one."""
MAX_CORNERS = 48
"""Largest number of corners of a mesh that are kept, even if others are further outside."""
SIDES = 32
"""Number of sides of the prism around a cylinder."""
CUBE = 2.0 * ((np.arange(8)[:, None] >> np.arange(3)) & 1) - 1.0
"""The corners of a cube from -1 to 1."""


class ClosestPoints(NamedTuple):
    """Points at which two shapes are nearest to each other.

    Attributes:
        distance: Distance between the surfaces; negative if they penetrate [m].
        direction: Unit vector from one to the other, in either sense, in the robot's root link.
        first: The point of one of them, in the root link [m].
        second: The point of the other, in the root link [m].
    """

    distance: float
    direction: Vector
    first: Vector
    second: Vector


class Solid(NamedTuple):
    """A convex shape that moves with a frame.

    Attributes:
        frame: Number of the frame, see `LinkFrames`.
        balls: v x 4: x, y and z in that frame, and a radius [m]. The convex hull of the balls contains the shape.
        normal: Outward normal of a half-space, whose boundary passes through the first ball; None for other shapes.
    """

    frame: int
    balls: np.ndarray
    normal: np.ndarray | None = None

    @property
    def extent(self) -> tuple[np.ndarray, np.ndarray]:
        """Least and greatest x, y and z [m]; inf and -inf without balls."""
        places, radius = self.balls[:, :3], self.balls[:, 3:]
        return (places - radius).min(axis=0, initial=np.inf), (places + radius).max(axis=0, initial=-np.inf)

    def moved(self, frame: int, pose: np.ndarray) -> "Solid":
        """Returns it in another frame, in which its present frame has a pose, 4 x 4."""
        turn, shift = pose[:3, :3], pose[:3, 3]
        balls = np.column_stack((self.balls[:, :3] @ turn.T + shift, self.balls[:, 3]))
        return Solid(frame, balls, None if self.normal is None else turn @ self.normal)

    def grown(self, by_m: float) -> "Solid":
        """Returns it with larger balls."""
        return self._replace(balls=self.balls + (0.0, 0.0, 0.0, by_m))


def extent_of(solids: Sequence[Solid]) -> tuple[np.ndarray, np.ndarray]:
    """Returns least and greatest x, y and z of some shapes in one frame [m]."""
    return Solid(0, np.concatenate([solid.balls for solid in solids] or [np.empty((0, 4))])).extent


def box_of(lower: np.ndarray, upper: np.ndarray) -> Solid:
    """Returns the box between least and greatest x, y and z [m]; a ball of NaN if least ones exceed greatest ones."""
    if (lower > upper).any():
        return Solid(0, np.full((1, 4), np.nan))
    corners = (lower + upper) / 2.0 + CUBE * (upper - lower) / 2.0
    return Solid(0, np.column_stack((corners, np.zeros(8))))


def balls_of(kind: str, size: tuple[float, ...]) -> np.ndarray:
    """Returns balls of a box, sphere, capsule or cylinder, v x 4; no balls of any other kind."""
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
    """Returns balls around some of the corners of a mesh, v x 4, whose hull contains the mesh.

    Corners are added one after the other: always the one that is furthest from all lines between those so far.
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
        for old in kept:
            away = np.minimum(away, _from_line(corners, corners[old], corners[new]))
        kept.append(new)
    return np.column_stack((corners[kept], np.full(len(kept), away.max() + MESH_MARGIN_M)))


def _from_line(points: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Returns the distances of v points from the line segment between two others."""
    way = end - start
    share = np.clip((points - start) @ way / (way @ way), 0.0, 1.0)
    distance: np.ndarray = np.linalg.norm(points - start - share[:, None] * way, axis=1)
    return distance
