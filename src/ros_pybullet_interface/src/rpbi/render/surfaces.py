"""Triangle meshes, with normals, of boxes, planes, capsules and cylinders."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

TOLERANCE_M = 2e-4
"""Largest distance [m] between a circle and the polygon that replaces it, unless that needs more than `MAX_CORNERS`."""
MIN_CORNERS, MAX_CORNERS = 24, 160
PLANE_HALF_WIDTH_M = 100.0
"""Half the edge length of the square that represents an infinite plane."""


class SurfaceMesh(NamedTuple):
    """A triangle mesh with a normal at each corner.

    Attributes:
        points: Positions [m] of the n corners, shape (n, 3).
        normals: Outward unit normals at the n corners, shape (n, 3).
        triangles: For each of t triangles, the indices of the triangle's corners in `points`, counter-clockwise as seen
            from outside, shape (t, 3).
    """

    points: Array
    normals: Array
    triangles: npt.NDArray[np.int64]

    def as_obj(self) -> str:
        """Returns the mesh as the text of a Wavefront OBJ file."""
        lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in self.points]
        lines += [f"vn {x:.9g} {y:.9g} {z:.9g}" for x, y, z in self.normals]
        lines += [f"f {a}//{a} {b}//{b} {c}//{c}" for a, b, c in self.triangles + 1]
        return "\n".join(lines) + "\n"


def box(half_extents: Sequence[float]) -> SurfaceMesh:
    """Returns a box centred at the origin; `half_extents` is half the size [m] along x, y and z.

    Each side has its own corners, with the side's normal.
    """
    unit = _concatenated([_square(sign * axis) for axis in np.eye(3) for sign in (1.0, -1.0)])
    return unit._replace(points=unit.points * np.asarray(half_extents))


def plane(normal: Sequence[float]) -> SurfaceMesh:
    """Returns a large square centred at the origin, visible from both sides; `normal` may have any length."""
    upwards = np.asarray(normal) / np.linalg.norm(normal)
    both = _concatenated([_square(upwards), _square(-upwards)])
    on_plane = both.points - (both.points @ upwards)[:, None] * upwards
    return both._replace(points=PLANE_HALF_WIDTH_M * on_plane)


def capsule(radius: float, length: float) -> SurfaceMesh:
    """Returns a capsule centred at the origin with its axis along z.

    Args:
        radius: Radius [m].
        length: Length of the cylindrical part [m]; 0 for a sphere.
    """
    corners = _corners(radius)
    equator = corners // 4
    latitude = np.linspace(-np.pi / 2, np.pi / 2, corners // 2 + 1)
    if length > 0.0:
        latitude = np.insert(latitude, equator, 0.0)  # the equator twice: at both ends of the cylindrical part
    profile = np.stack([np.cos(latitude), np.sin(latitude)], axis=1)
    shift = np.where(np.arange(len(latitude)) <= equator, -length / 2, length / 2)
    return _turned(radius * profile + np.stack([0.0 * shift, shift], axis=1), profile, corners)


def cylinder(radius: float, length: float) -> SurfaceMesh:
    """Returns a cylinder with closed ends, centred at the origin with its axis along z; all lengths are in metres."""
    half = length / 2
    outline = np.array([[0, -half], [radius, -half], [radius, -half], [radius, half], [radius, half], [0, half]])
    normals = np.array([[0, -1], [0, -1], [1, 0], [1, 0], [0, 1], [0, 1]], float)
    rows = (slice(begin, begin + 2) for begin in (0, 2, 4))
    return _concatenated([_turned(outline[row], normals[row], _corners(radius)) for row in rows])


def mesh(points: Array, triangles: npt.NDArray[Any], normals: Array | None = None) -> SurfaceMesh:
    """Returns a mesh with given corners and triangles.

    Args:
        points: Positions [m] of the n corners, shape (n, 3).
        triangles: For each of t triangles, the indices of the triangle's corners in `points`, shape (t, 3).
        normals: Unit normals at the n corners, shape (n, 3); None gives each triangle's corners the triangle's normal.
    """
    if normals is not None:
        return SurfaceMesh(points, normals, triangles)
    corners = points[triangles]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(across, axis=1, keepdims=True)
    flat = np.divide(across, length, out=np.zeros_like(across), where=length > 0.0)
    return SurfaceMesh(corners.reshape(-1, 3), np.repeat(flat, 3, axis=0), np.arange(corners.size // 3).reshape(-1, 3))


def _square(outward: Array) -> SurfaceMesh:
    """Returns one side of the cube from -1 to 1 along each axis; `outward` is the side's outward unit normal."""
    first = np.roll(np.eye(3)[np.argmax(np.abs(outward))], 1)
    u = np.cross(outward, first)
    u /= np.linalg.norm(u)
    v = np.cross(outward, u)
    points = np.array([outward - u - v, outward + u - v, outward + u + v, outward - u + v])
    return SurfaceMesh(points, np.tile(outward, (4, 1)), np.array([[0, 1, 2], [0, 2, 3]]))


def _corners(radius: float) -> int:
    """Returns the number of corners, a multiple of 4, of the polygon that replaces a circle of radius `radius` [m]."""
    needed = np.pi / np.arccos(1.0 - min(TOLERANCE_M / radius, 1.0))
    return int(np.clip(4 * np.ceil(needed / 4), MIN_CORNERS, MAX_CORNERS))


def _turned(profile: Array, normals: Array, corners: int) -> SurfaceMesh:
    """Returns the surface of revolution of an outline about z.

    Args:
        profile: Distance from the z axis and height of n points of the outline, from bottom to top, shape (n, 2).
        normals: Outward normals of the outline at these points, in the same coordinates, shape (n, 2).
        corners: Number of corners of the polygons that replace circles about z.
    """
    angle = np.linspace(0.0, 2.0 * np.pi, corners + 1)
    around = np.stack([np.cos(angle), np.sin(angle)], axis=1)

    def turn(outline: Array) -> Array:
        flat = outline[:, None, :1] * around
        height = np.broadcast_to(outline[:, None, 1:], (*flat.shape[:2], 1))
        return np.concatenate([flat, height], axis=2).reshape(-1, 3)

    rows, columns = np.meshgrid(np.arange(len(profile) - 1), np.arange(corners), indexing="ij")
    corner = (rows * (corners + 1) + columns).ravel()
    right, up = corner + 1, corner + corners + 1
    triangles = np.concatenate([np.stack([corner, right, up + 1], 1), np.stack([corner, up + 1, up], 1)])
    points = turn(profile)
    a, b, c = (points[triangles[:, index]] for index in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return SurfaceMesh(points, turn(normals), triangles[area > 1e-12 * max(area.max(), 1e-300)])


def _concatenated(parts: Sequence[SurfaceMesh]) -> SurfaceMesh:
    begins = np.cumsum([0] + [len(part.points) for part in parts[:-1]])
    return SurfaceMesh(
        np.concatenate([part.points for part in parts]),
        np.concatenate([part.normals for part in parts]),
        np.concatenate([part.triangles + begin for part, begin in zip(parts, begins)]),
    )
