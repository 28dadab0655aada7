"""Reads the meshes of a page, and simplifies them if they have too many triangles."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from custom_ros_tools.errors import MissingDependency
from rpbi.bodies.visual_shapes import BodyShape, ShapeKind
from rpbi.meshes.triangles import read_triangles

from .scene import Array, TriangleMesh

try:
    from fast_simplification import simplify
    from trimesh import Trimesh
    from trimesh.graph import smooth_shade
except ImportError as error:
    raise MissingDependency(error.name or "trimesh", "./rpbi setup html") from None

MAX_TRIANGLES = 18_000
"""Total number of triangles on a page of an episode above which the meshes are simplified."""
MIN_TRIANGLES = 200
"""Smallest number of triangles to which a mesh is reduced; smaller meshes are not simplified."""
CREASE_RAD = 0.6
"""Angle between two triangles above which their common edge is visible [rad]."""
_SAME_M = 1e-6
"""Grid to which mesh corners are rounded, in the units of the mesh file. Corners at the same grid point are merged."""


def meshes_of(
    shapes: Iterable[BodyShape], max_triangles: int = MAX_TRIANGLES
) -> tuple[dict[BodyShape, TriangleMesh], list[str]]:
    """Returns the meshes of shapes. If they have too many triangles in total, all meshes are simplified.

    Args:
        shapes: Shapes of any kind. Shapes that are not meshes are left out.
        max_triangles: Total number of triangles above which the meshes are simplified.

    Returns:
        The meshes, indexed by shape, and messages about unreadable meshes and about simplification.
    """
    read: dict[object, Trimesh | None] = {}
    notes = []
    wanted = [shape for shape in shapes if shape.kind in (ShapeKind.MESH, ShapeKind.TRIANGLES)]
    for shape in wanted:
        if _key(shape) not in read:
            try:
                read[_key(shape)] = _merged(_corners(shape))
            except (ValueError, OSError) as error:
                read[_key(shape)] = None
                notes.append(f"a mesh is not shown: {' '.join(str(error).split())}")
    found = {key: mesh for key, mesh in read.items() if mesh is not None}
    total = sum(len(mesh.faces) for mesh in found.values())
    share = max_triangles / max(total, max_triangles)
    shown = {key: smooth_shade(_simplified(mesh, share), angle=CREASE_RAD) for key, mesh in found.items()}
    left = sum(len(mesh.faces) for mesh in shown.values())
    if left < total:
        notes.append(f"meshes are simplified: they have {left:,} instead of {total:,} triangles")
    return {shape: _scaled(shown[_key(shape)], shape) for shape in wanted if _key(shape) in shown}, notes


def _scaled(mesh: Trimesh, shape: BodyShape) -> TriangleMesh:
    return TriangleMesh((mesh.vertices * shape.size).astype(np.float32), mesh.faces.astype(np.uint32))


def _key(shape: BodyShape) -> object:
    return shape.mesh_file if shape.kind is ShapeKind.MESH else shape.corners


def _corners(shape: BodyShape) -> Array:
    """Returns the corners of a mesh's n triangles before scaling, shape (n, 3, 3)."""
    if shape.kind is ShapeKind.MESH:
        return np.concatenate(read_triangles(shape.mesh_file))
    return np.reshape(shape.corners, (-1, 3, 3))


def _merged(corners: Array) -> Trimesh:
    """Returns the mesh of given triangles, in which adjacent triangles share corners."""
    numbers = np.round(corners.reshape(-1, 3) / _SAME_M).astype(np.int64)
    _, first, inverse = np.unique(numbers, axis=0, return_index=True, return_inverse=True)
    faces = inverse.reshape(-1, 3)
    is_flat = (faces == np.roll(faces, 1, axis=1)).any(axis=1)
    return Trimesh(corners.reshape(-1, 3)[first], faces[~is_flat], process=False)


def _simplified(mesh: Trimesh, share: float) -> Trimesh:
    wanted = max(MIN_TRIANGLES, int(share * len(mesh.faces)))
    if wanted >= len(mesh.faces):
        return mesh
    points, faces = simplify(mesh.vertices.astype(np.float32), mesh.faces.astype(np.int32), target_count=wanted)[:2]
    return Trimesh(points, faces, process=False)
