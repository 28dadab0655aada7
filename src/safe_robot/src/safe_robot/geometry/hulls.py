"""Few balls whose convex hull holds the collision shapes of a link."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pybullet
from scipy.spatial import ConvexHull, QhullError

from custom_ros_tools.transforms import matrix_of
from rpbi.engine.client import Client

MESH_MARGIN_M = 1e-3
"""By so much PyBullet makes convex meshes thicker [m]."""
COARSE_M = 2e-3
"""So far corners of a mesh may be outside the hull of those that are kept; the balls are that much larger [m]."""
AABB_MARGIN_M = 4e-3
"""By so much PyBullet's boxes around shapes are too wide, at most [m]."""
SIDES = 16
"""Of the prism that is put around a cylinder."""


@dataclass(frozen=True)
class Solid:
    """A thing that moves in one piece.

    Attributes:
        frame: The frame that it moves with, see `LinkFrames`.
        balls: v x 4: x, y and z in that frame, and a radius [m]. The convex hull of the balls holds the thing.
        normal: Of a half-space that ends at the first ball, the way out of it; None for everything else.
    """

    frame: int
    balls: np.ndarray
    normal: np.ndarray | None = None

    @cached_property
    def middle(self) -> np.ndarray:
        """A point inside, x, y, z [m]."""
        middle: np.ndarray = self.balls[:, :3].mean(axis=0)
        return middle

    def moved(self, frame: int, pose: np.ndarray) -> "Solid":
        """Returns it in another frame, in which its own one has a pose, 4 x 4."""
        turn, shift = pose[:3, :3], pose[:3, 3]
        balls = np.column_stack((self.balls[:, :3] @ turn.T + shift, self.balls[:, 3]))
        return Solid(frame, balls, None if self.normal is None else turn @ self.normal)


def solid_of(pb: Client, body: int, link: int) -> Solid:
    """Returns the collision shapes of a link as one solid, in the frame of its centre of mass.

    What PyBullet does not tell the corners of counts as the box around it, as it lies now.
    """
    shapes = pb.getCollisionShapeData(body, link)
    if any(shape[2] == pybullet.GEOM_PLANE for shape in shapes):
        return Solid(0, np.zeros((1, 4)), np.array((0.0, 0.0, 1.0)))
    pose = matrix_of(*(pb.getLinkState(body, link)[:2] if link >= 0 else pb.getBasePositionAndOrientation(body)))
    lower, upper = pb.getAABB(body, link)
    found = [_balls(*shape[2:4], matrix_of(*shape[5:7])) for shape in shapes if shape[2] != pybullet.GEOM_MESH]
    meshes = [i for i, shape in enumerate(shapes) if shape[2] == pybullet.GEOM_MESH]
    corners = [corner for i in meshes for corner in pb.getMeshData(body, link, collisionShapeIndex=i)[1]]
    if corners:
        found.append(_few(np.array(corners)))
    balls = np.concatenate(found) if found else np.empty((0, 4))
    in_world = Solid(0, balls).moved(0, pose).balls
    is_known = len(balls) > 0 and np.isfinite(balls).all()
    if is_known:
        least = (in_world[:, :3] - in_world[:, 3:]).min(axis=0) - AABB_MARGIN_M
        most = (in_world[:, :3] + in_world[:, 3:]).max(axis=0) + AABB_MARGIN_M
        is_known = bool((least <= lower).all() and (most >= upper).all())
    if is_known:
        return Solid(0, balls)
    middle, half = np.add(lower, upper) / 2.0, np.subtract(upper, lower) / 2.0
    box = np.column_stack((_signs(8) * half + middle, np.zeros(8)))
    return Solid(0, box).moved(0, np.linalg.inv(pose))


def _balls(kind: int, size: tuple[float, ...], pose: np.ndarray) -> np.ndarray:
    """Returns balls of a shape that is no mesh, v x 4; none of an unknown one. PyBullet has it in a pose, 4 x 4."""
    if kind == pybullet.GEOM_BOX:
        balls = np.column_stack((_signs(8) * size / 2.0, np.zeros(8)))
    elif kind == pybullet.GEOM_SPHERE:
        balls = np.array(((0.0, 0.0, 0.0, size[0]),))
    elif kind == pybullet.GEOM_CAPSULE:
        balls = np.array([(0.0, 0.0, z * size[0] / 2.0, size[1]) for z in (-1.0, 1.0)])
    elif kind == pybullet.GEOM_CYLINDER:
        radius = size[1] / math.cos(math.pi / SIDES)
        angles = 2.0 * math.pi / SIDES * np.arange(SIDES)
        balls = np.array([(x, y, z * size[0] / 2.0, 0.0) for z in (-1.0, 1.0) for x, y in _circle(radius, angles)])
    else:
        return np.full((1, 4), np.nan)
    return Solid(0, balls).moved(0, pose).balls


def _circle(radius: float, angles: np.ndarray) -> np.ndarray:
    return radius * np.column_stack((np.cos(angles), np.sin(angles)))


def _signs(count: int) -> np.ndarray:
    """Returns the corners of a cube from -1 to 1."""
    return 2.0 * ((np.arange(count)[:, None] >> np.arange(3)) & 1) - 1.0


def _few(corners: np.ndarray) -> np.ndarray:
    """Returns balls around some of the corners of a mesh, v x 4, whose hull holds that of the mesh.

    The one that is furthest from all lines between those that are kept is kept next.
    """
    try:
        corners = corners[ConvexHull(corners).vertices]
    except QhullError:  # a flat one
        corners = np.unique(corners, axis=0)
    kept = [int(np.argmax(np.linalg.norm(corners - corners.mean(axis=0), axis=1)))]
    away = np.linalg.norm(corners - corners[kept[0]], axis=1)
    while away.max() > COARSE_M:
        new = int(np.argmax(away))
        for old in kept:
            away = np.minimum(away, _from_line(corners, corners[old], corners[new]))
        kept.append(new)
    return np.column_stack((corners[kept], np.full(len(kept), away.max() + MESH_MARGIN_M)))


def _from_line(points: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Returns how far v points are from a line between two."""
    way = end - start
    share = np.clip((points - start) @ way / (way @ way), 0.0, 1.0)
    distance: np.ndarray = np.linalg.norm(points - start - share[:, None] * way, axis=1)
    return distance
