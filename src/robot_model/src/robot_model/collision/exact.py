"""Distances between exact shapes, measured by hpp-fcl. Meshes are measured as triangles instead of convex hulls."""

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from custom_ros_tools.errors import MissingDependency
from robot_model.geometry import ZERO, Vector, minus, scaled

try:
    import hppfcl
except ImportError:
    raise MissingDependency("hpp-fcl", "./rpbi setup ik") from None

from .fcl import load_mesh, primitive, transform
from .shapes import CollisionShape, Obstacle, ObstacleKind
from .solids import ClosestPoints, Solid, extent_of

TOUCHING_M = 1e-5
"""Distance up to which shapes count as intersecting [m], since the direction between so near points is undefined."""
OUT_OF_PLACE_M = 0.015
"""Largest difference between the bounding boxes of a link's exact shapes and of the link's hulls [m]."""
SAME_M = 1e-7
"""Grid size [m]: corners of a mesh that round to the same grid point count as one corner."""


class Surface(NamedTuple):
    """Triangles of a mesh.

    Attributes:
        triangles: Corners of the t triangles, t x 3 x 3 [m].
        points: One corner of each connected part of the mesh, p x 3 [m].
        lower: Smallest x, y and z of all corners [m].
        upper: Largest x, y and z of all corners [m].
    """

    triangles: np.ndarray
    points: np.ndarray
    lower: np.ndarray
    upper: np.ndarray

    def holds(self, points: np.ndarray) -> bool:
        """Returns whether the mesh contains at least one of k points, k x 3 [m].

        A point is inside if the solid angles of all triangles, seen from the point, add up to the full sphere (Van
        Oosterom and Strackee 1983).
        """
        for point in points[((points >= self.lower) & (points <= self.upper)).all(axis=1)]:
            a, b, c = (self.triangles - point).transpose(1, 0, 2)
            u, v, w = (np.linalg.norm(each, axis=1) for each in (a, b, c))
            volume = (a * np.cross(b, c)).sum(axis=1)
            rest = u * v * w + (a * b).sum(axis=1) * w + (b * c).sum(axis=1) * u + (c * a).sum(axis=1) * v
            if not abs(np.arctan2(volume, rest).sum()) < math.pi:  # 2 pi inside, 0 outside
                return True
        return False


class Piece(NamedTuple):
    """An exact shape that moves with a frame.

    Attributes:
        frame: Number of the frame, see `LinkFrames`.
        pose: Pose of the shape in the frame, 4 x 4.
        shape: The hpp-fcl object.
        surface: Triangles of a mesh; None for other shapes.
    """

    frame: int
    pose: np.ndarray
    shape: Any
    surface: Surface | None = None

    def moved(self, frame: int, pose: np.ndarray) -> "Piece":
        """Returns the shape expressed in another frame.

        Args:
            frame: Number of the other frame.
            pose: Pose of the shape's current frame in the other frame, 4 x 4.
        """
        return self._replace(frame=frame, pose=pose @ self.pose)


def pieces_of_link(shapes: Sequence[CollisionShape], solids: Sequence[Solid]) -> list[Piece]:
    """Returns the exact collision shapes of a link, in the link's frame.

    Args:
        shapes: The link's shapes as the URDF describes them.
        solids: Solids that contain the link's hulls, in the link's frame.

    Raises:
        ValueError: If a mesh cannot be read, or the extents of the exact shapes and of the hulls differ.
    """
    return _placed([_piece(each.kind, each.size, each.mesh_file, each.pose) for each in shapes], solids)


def pieces_of_obstacle(obstacle: Obstacle, solids: Sequence[Solid]) -> list[Piece]:
    """Returns the exact shape of an obstacle in the obstacle's frame; see `pieces_of_link`.

    The list is empty for planes and point sets, which are measured as hulls.
    """
    if obstacle.kind in ("plane", "points"):
        return []
    return _placed([_piece(obstacle.kind, obstacle.link_size, obstacle.mesh_file, np.eye(4))], solids)


def _piece(kind: ObstacleKind, size: tuple[float, ...], file: str, pose: np.ndarray) -> Piece:
    return Piece(0, pose, *_mesh(file, size)) if kind == "mesh" else Piece(0, pose, primitive(kind, size))


def _placed(pieces: list[Piece], solids: Sequence[Solid]) -> list[Piece]:
    extent, expected = (np.array(extent_of(each)) for each in ([_corners(piece) for piece in pieces], solids))
    if pieces and not (np.abs(extent - expected) < OUT_OF_PLACE_M).all():
        raise ValueError(f"expected exact shapes where hulls are, {expected.tolist()} m, got {extent.tolist()} m")
    return pieces


def nearest(
    firsts: Sequence[Piece], seconds: Sequence[Piece], frames: np.ndarray, within_m: float
) -> ClosestPoints | None:
    """Returns the closest points between two groups of shapes; None if the groups intersect.

    Args:
        firsts: Shapes of the first group.
        seconds: Shapes of the second group.
        frames: Poses of the m frames of `LinkFrames` in the root frame, m x 4 x 4.
        within_m: Largest distance that is measured [m]. If the groups are further apart, the returned distance is inf.
    """
    found = ClosestPoints(math.inf, ZERO, ZERO, ZERO)
    request = hppfcl.CollisionRequest()
    request.security_margin = within_m
    for first in firsts:
        place = frames[first.frame] @ first.pose
        for second in seconds:
            other = frames[second.frame] @ second.pose
            shapes = first.shape, transform(place), second.shape, transform(other)
            if hppfcl.collide(*shapes, request, hppfcl.CollisionResult()):
                result = hppfcl.DistanceResult()
                distance = hppfcl.distance(*shapes, hppfcl.DistanceRequest(True), result)
                if not distance > TOUCHING_M:
                    return None
                if distance < found.distance:
                    ends: tuple[Vector, Vector] = tuple(result.getNearestPoint1()), tuple(result.getNearestPoint2())
                    found = ClosestPoints(distance, scaled(1.0 / distance, minus(*ends)), *ends)
            elif _is_inside(first, second, np.linalg.solve(other, place)):
                return None
            elif _is_inside(second, first, np.linalg.solve(place, other)):
                return None
    return found


def _is_inside(piece: Piece, other: Piece, pose: np.ndarray) -> bool:
    """Returns whether `other` encloses a connected part of `piece`. The surfaces must not touch.

    Args:
        piece: The piece that may be enclosed.
        other: The piece that may enclose a part of `piece`.
        pose: Pose of `piece` in the frame of `other`, 4 x 4.
    """
    if other.surface is None:  # a solid for hpp-fcl, whose collision check also detects pieces inside the solid
        return False
    points = np.zeros((1, 3)) if piece.surface is None else piece.surface.points
    return other.surface.holds(points @ pose[:3, :3].T + pose[:3, 3])


@lru_cache(maxsize=64)
def _mesh(file: str, scale: tuple[float, ...]) -> tuple[Any, Surface]:
    """Reads a mesh, and returns the hpp-fcl object and the triangles.

    Raises:
        ValueError: If the mesh cannot be read.
    """
    try:
        mesh = load_mesh(file, scale)
        corners = np.array(mesh.vertices())
        rows = np.array([[mesh.tri_indices(i)[k] for k in range(3)] for i in range(mesh.num_tris)])
        triangles = corners[rows]
    except IndexError as error:
        raise ValueError(f"mesh {file}: {error}") from None
    if not np.isfinite(triangles).all():
        raise ValueError(f"mesh {file}: expected finite corners")
    _, first, same = np.unique((corners / SAME_M).round(), axis=0, return_index=True, return_inverse=True)
    ends = same.reshape(-1)[rows]
    edges = np.concatenate((ends[:, :2], ends[:, 1:]))
    count, part = connected_components(coo_matrix((np.ones(len(edges)), edges.T), (len(first),) * 2), directed=False)
    used = np.isin(np.arange(len(first)), ends)
    points = [corners[first[np.flatnonzero((part == i) & used)[:1]]] for i in range(count)]
    return mesh, Surface(triangles, np.concatenate(points), triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1)))


def _corners(piece: Piece) -> Solid:
    """Returns the corners of a mesh, or of the bounding box of any other shape, as balls of radius 0."""
    if piece.surface is None:
        piece.shape.computeLocalAABB()
        low, high = piece.shape.aabb_local.min_, piece.shape.aabb_local.max_
        points = np.stack(np.meshgrid(*np.stack((low, high), axis=1)), axis=-1).reshape(-1, 3)
    else:
        points = piece.surface.triangles.reshape(-1, 3)
    return Solid(0, np.column_stack((points, np.zeros(len(points))))).moved(0, piece.pose)
