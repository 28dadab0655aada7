"""Replaces PyBullet's primitive visual shapes by meshes.

PyBullet draws spheres and cylinders with few triangles (the error of a sphere of 0.2 m is up to 13 mm), and smooths the
edges of boxes in its shading. With EGL, PyBullet crashes on visual planes and on meshes without a file. The renderer
process therefore draws meshes from files instead. PyBullet's EGL plugin confuses transparent shapes from the same path,
so each transparent shape gets its own path to the file, such as `./shape_0.obj`.
"""

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pybullet

from custom_ros_tools.files import temporary_folder
from rpbi.config.pybullet_models import CreateVisualShape

from . import surfaces
from .surfaces import SurfaceMesh

_SHAPE_KEYS = ("radius", "halfExtents", "length", "planeNormal", "vertices", "indices", "normals", "uvs")
_DEFAULT_RADIUS_M, _DEFAULT_LENGTH_M, _DEFAULT_HALF_EXTENTS_M = 0.5, 1.0, (1.0, 1.0, 1.0)
"""PyBullet's own defaults."""

_SPECK = surfaces.mesh(1e-6 * np.eye(3), np.array([[0, 1, 2]]))
"""Tiny triangle that replaces invisible shapes, which EGL would draw into the depth and segmentation images."""


class FineShapes:
    """Converts PyBullet's primitive shapes to meshes, and stores the meshes as files in a temporary folder."""

    def __init__(self) -> None:
        self._folder = temporary_folder("shapes")
        self._files: dict[bytes, str] = {}
        self._transparent_count = 0
        self._surface_of: dict[int, Callable[[CreateVisualShape], SurfaceMesh | None]] = {
            pybullet.GEOM_SPHERE: lambda shape: surfaces.capsule(shape.radius or _DEFAULT_RADIUS_M, 0.0),
            pybullet.GEOM_CAPSULE: lambda shape: surfaces.capsule(*_round_size(shape)),
            pybullet.GEOM_CYLINDER: lambda shape: surfaces.cylinder(*_round_size(shape)),
            pybullet.GEOM_BOX: lambda shape: surfaces.box(shape.halfExtents or _DEFAULT_HALF_EXTENTS_M),
            pybullet.GEOM_PLANE: lambda shape: surfaces.plane(shape.planeNormal or (0.0, 0.0, 1.0)),
            pybullet.GEOM_MESH: _inline_mesh,
        }

    def of(self, shape: CreateVisualShape) -> CreateVisualShape:
        """Returns the shape to draw in place of the visual shape `shape`.

        Primitive shapes, invisible shapes and meshes without a file become meshes from files. A transparent mesh gets
        its own path to its file. Other shapes are returned unchanged.
        """
        opacity = 1.0 if shape.rgbaColor is None else shape.rgbaColor[3]
        make = self._surface_of.get(shape.shapeType)
        surface = _SPECK if not opacity else make(shape) if make else None
        file = shape.fileName if surface is None else self._file(surface)
        if file is None:
            return shape
        if opacity < 1.0:
            file = self._as_another_file(file)
        kept = {key: value for key, value in shape if key in shape.model_fields_set and key not in _SHAPE_KEYS}
        return CreateVisualShape.model_construct(**{**kept, "shapeType": pybullet.GEOM_MESH, "fileName": file})

    def close(self) -> None:
        """Deletes the mesh files."""
        self._folder.cleanup()

    def _as_another_file(self, file: str) -> str:
        """Returns a new path to the same file, by repeating `./`, so that PyBullet loads the file again."""
        self._transparent_count += 1
        folder, name = os.path.split(file)
        return os.path.join(folder, "./" * self._transparent_count + name)

    def _file(self, surface: SurfaceMesh) -> str:
        """Writes a surface to a file and returns the path; equal surfaces share a file, which PyBullet reads once."""
        key = b"".join(part.tobytes() for part in surface)
        if key not in self._files:
            path = Path(self._folder.name) / f"shape_{len(self._files)}.obj"
            path.write_text(surface.as_obj())
            self._files[key] = str(path)
        return self._files[key]


def _round_size(shape: CreateVisualShape) -> tuple[float, float]:
    return shape.radius or _DEFAULT_RADIUS_M, shape.length or _DEFAULT_LENGTH_M


def _inline_mesh(shape: CreateVisualShape) -> SurfaceMesh | None:
    if shape.fileName is not None or not shape.vertices or not shape.indices:
        return None
    triangles = np.array(shape.indices).reshape(-1, 3)
    has_normals = shape.normals is not None and len(shape.normals) == len(shape.vertices)
    normals = np.array(shape.normals) if has_normals else None
    return surfaces.mesh(np.array(shape.vertices), triangles, normals)
