"""Few balls whose convex hull holds a collision shape."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pybullet
from scipy.spatial import ConvexHull, QhullError

from custom_ros_tools.transforms import matrix_of
from rpbi.engine.client import Client
from rpbi.geometry import Vector

from .obstacles import NO_FILE

MESH_MARGIN_M = 1e-3
"""By so much PyBullet makes convex meshes thicker [m]."""
EDGE_M = (math.sqrt(3.0) - 1.0) * 1e-3
"""So far corners of boxes are, at most, from those that PyBullet rounds, with a radius of 1 mm [m]."""
EDGED = (pybullet.GEOM_BOX, pybullet.GEOM_CYLINDER)
"""Shapes whose edges and corners it rounds."""
COARSE_M = 2e-3
"""So far corners of a mesh may be outside the hull of those that are kept; the balls are that much larger [m]."""
MOST = 48
"""Of a mesh no more corners are kept, even if others are further outside."""
AABB_MARGIN_M = 6e-3
"""By so much PyBullet's boxes around shapes are too wide, at most [m]."""
SIDES = 32
"""Of the prism that is put around a cylinder."""
CUBE = 2.0 * ((np.arange(8)[:, None] >> np.arange(3)) & 1) - 1.0
"""The corners of a cube from -1 to 1."""


class Solid(NamedTuple):
    """A convex shape that moves with a frame.

    Attributes:
        frame: The frame that it moves with, see `LinkFrames`.
        balls: v x 4: x, y and z in that frame, and a radius [m]. The convex hull of the balls holds the shape.
        normal: Of a half-space that ends at the first ball, the way out of it; None for everything else.
    """

    frame: int
    balls: np.ndarray
    normal: np.ndarray | None = None

    @property
    def extent(self) -> tuple[np.ndarray, np.ndarray]:
        """Least and greatest x, y and z [m]; inf and -inf of nothing."""
        places, radius = self.balls[:, :3], self.balls[:, 3:]
        return (places - radius).min(axis=0, initial=np.inf), (places + radius).max(axis=0, initial=-np.inf)

    def moved(self, frame: int, pose: np.ndarray) -> "Solid":
        """Returns it in another frame, in which its own one has a pose, 4 x 4."""
        turn, shift = pose[:3, :3], pose[:3, 3]
        balls = np.column_stack((self.balls[:, :3] @ turn.T + shift, self.balls[:, 3]))
        return Solid(frame, balls, None if self.normal is None else turn @ self.normal)

    def grown(self, by_m: float) -> "Solid":
        """Returns it with larger balls."""
        return self._replace(balls=self.balls + (0.0, 0.0, 0.0, by_m))


def solids_of(pb: Client, body: int, link: int) -> list[Solid]:
    """Returns the collision shapes of a link, in the frame of its centre of mass, larger by `missing_m`."""
    return [solid.grown(missing_m(pb, body, link)) for solid in _solids_of(pb, body, link)]


def extent_of(solids: Sequence[Solid]) -> tuple[np.ndarray, np.ndarray]:
    """Returns least and greatest x, y and z of some shapes in one frame [m]."""
    return Solid(0, np.concatenate([solid.balls for solid in solids] or [np.empty((0, 4))])).extent


def missing_m(pb: Client, body: int, link: int) -> float:
    """Returns how much nearer a link may be than PyBullet measures, since it rounds edges [m]."""
    return EDGE_M * any(shape[2] in EDGED for shape in pb.getCollisionShapeData(body, link))


def _solids_of(pb: Client, body: int, link: int) -> list[Solid]:
    """Returns the shapes as they are.

    If PyBullet does not tell the corners of each, the link counts as the box around it, as it lies now. So it does if
    some shapes are meshes of files and others are not, or lie askew to each other.
    """
    shapes = pb.getCollisionShapeData(body, link)
    if any(shape[2] == pybullet.GEOM_PLANE for shape in shapes):
        return [Solid(0, np.zeros((1, 4)), np.array((0.0, 0.0, 1.0)))]
    state = pb.getLinkState(body, link)[:2] if link >= 0 else pb.getBasePositionAndOrientation(body)
    pose = matrix_of(*state)
    shapes_of_files = [shape for shape in shapes if shape[2] == pybullet.GEOM_MESH and shape[4].decode() not in NO_FILE]
    solids, places = list[Solid](), [matrix_of(*shape[5:7]) for shape in shapes]
    if not shapes_of_files:
        for i, (shape, place) in enumerate(zip(shapes, places)):
            if shape[2] == pybullet.GEOM_MESH:
                solids.append(Solid(0, _few(pb.getMeshData(body, link, collisionShapeIndex=i)[1])))
            else:
                solids.append(Solid(0, _balls(*shape[2:4])).moved(0, place))
    elif len(shapes_of_files) == len(shapes):  # PyBullet makes several shapes of each: they cannot be told apart
        solids.append(Solid(0, _few(pb.getMeshData(body, link)[1])))
    boxes = [_box(*each.moved(0, np.linalg.inv(place)).extent).moved(0, place) for each, place in zip(solids, places)]
    lower, upper = pb.getAABB(body, link)
    if boxes and all(np.isfinite(box.balls).all() for box in boxes):
        # PyBullet's box is around the boxes of shapes, too: it is as large, unless there is more than it tells of
        least, most = _box(*Solid(0, np.concatenate([box.balls for box in boxes])).extent).moved(0, pose).extent
        if (least - AABB_MARGIN_M <= lower).all() and (most + AABB_MARGIN_M >= upper).all():
            return solids
    return [_box(np.array(lower), np.array(upper)).moved(0, np.linalg.inv(pose))]


def _box(lower: np.ndarray, upper: np.ndarray) -> Solid:
    if (lower > upper).any():
        return Solid(0, np.full((1, 4), np.nan))
    corners = (lower + upper) / 2.0 + CUBE * (upper - lower) / 2.0
    return Solid(0, np.column_stack((corners, np.zeros(8))))


def _balls(kind: int, size: tuple[float, ...]) -> np.ndarray:
    """Returns balls of a shape that is no mesh, v x 4; none of an unknown one."""
    if kind == pybullet.GEOM_BOX:
        half = np.array(size) / 2.0
        return _box(-half, half).balls
    if kind == pybullet.GEOM_SPHERE:
        return np.array(((0.0, 0.0, 0.0, size[0]),))
    if kind == pybullet.GEOM_CAPSULE:
        return np.array([(0.0, 0.0, z * size[0] / 2.0, size[1]) for z in (-1.0, 1.0)])
    if kind == pybullet.GEOM_CYLINDER:
        angles = 2.0 * math.pi / SIDES * np.arange(SIDES)
        x, y = size[1] / math.cos(math.pi / SIDES) * np.array((np.cos(angles), np.sin(angles)))
        ends = [np.column_stack((x, y, np.full(SIDES, z), np.zeros(SIDES))) for z in (-size[0] / 2.0, size[0] / 2.0)]
        return np.concatenate(ends)
    return np.empty((0, 4))


def _few(points: Sequence[Vector]) -> np.ndarray:
    """Returns balls around some of the corners of a mesh, v x 4, whose hull holds that of the mesh.

    The one that is furthest from all lines between those that are kept is kept next.
    """
    if not points:
        return np.empty((0, 4))
    corners = np.array(points)
    try:
        corners = corners[ConvexHull(corners).vertices]
    except QhullError:  # a flat one
        corners = np.unique(corners, axis=0)
    kept = [int(np.argmax(np.linalg.norm(corners - corners.mean(axis=0), axis=1)))]
    away = np.linalg.norm(corners - corners[kept[0]], axis=1)
    while away.max() > COARSE_M and len(kept) < MOST:
        new = int(np.argmax(away))
        for old in kept:
            away = np.minimum(away, _from_line(corners, corners[old], corners[new]))
        kept.append(new)
    return np.column_stack((corners[kept], np.full(len(kept), away.max() + MESH_MARGIN_M)))


def _from_line(points: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Returns how far v points are from a line between two others."""
    way = end - start
    share = np.clip((points - start) @ way / (way @ way), 0.0, 1.0)
    distance: np.ndarray = np.linalg.norm(points - start - share[:, None] * way, axis=1)
    return distance
