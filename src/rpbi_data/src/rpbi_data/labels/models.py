"""Models of objects' visible surfaces, which a data set contains. Identical objects share a model."""

from __future__ import annotations

import io
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial import ConvexHull, QhullError
from scipy.spatial.distance import pdist

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.transforms import matrix_of
from rpbi.bodies import Body
from rpbi.bodies.visual_shapes import BodyShape, ShapeKind, body_shapes
from rpbi.meshes.triangles import read_triangles
from rpbi.render import surfaces

Array = npt.NDArray[np.float64]
MM = 1000.0
"""Number of millimetres in a metre."""


class ObjectModel(NamedTuple):
    """The visible surface of objects that have the same shapes and colours.

    Attributes:
        obj_id: Number of the model, starting at 1.
        name: Name of the first object with this model.
        points: Corners in the frame of the object's base link, shape (n, 3) [m].
        triangles: Indices of the three corners of each triangle, shape (m, 3).
        rgb: Colour of each corner, from 0 to 255, shape (n, 3). Textures are ignored.
    """

    obj_id: int
    name: str
    points: Array
    triangles: npt.NDArray[np.int64]
    rgb: npt.NDArray[np.uint8]

    @property
    def centre(self) -> Array:
        """Centre of the model's bounding box, shape (3,) [m]."""
        middle: Array = (self.points.min(axis=0) + self.points.max(axis=0)) / 2.0
        return middle

    @property
    def radius(self) -> float:
        """Radius of the smallest ball around `centre` that encloses the model [m]."""
        return float(np.linalg.norm(self.points - self.centre, axis=1).max())

    def info(self) -> dict[str, float]:
        """Returns the model's entry in `models_info.json`: diameter and bounding box [mm]."""
        low, size = MM * self.points.min(axis=0), MM * np.ptp(self.points, axis=0)
        entry = {"diameter": MM * _diameter(self.points)}
        entry |= {f"min_{axis}": value for axis, value in zip("xyz", low)}
        entry |= {f"size_{axis}": value for axis, value in zip("xyz", size)}
        return {key: round(float(value), 4) for key, value in entry.items()}

    def as_ply(self) -> str:
        """Returns the model as the text of a PLY file with corners [mm], normals, colours and triangles."""
        properties = [f"property float {name}" for name in ("x", "y", "z", "nx", "ny", "nz")]
        properties += [f"property uchar {name}" for name in ("red", "green", "blue")]
        text = io.StringIO()
        text.write(f"ply\nformat ascii 1.0\nelement vertex {len(self.points)}\n" + "\n".join(properties))
        text.write(f"\nelement face {len(self.triangles)}\nproperty list uchar int vertex_indices\nend_header\n")
        rows = np.hstack([MM * self.points, self._normals(), self.rgb])
        np.savetxt(text, rows, fmt=["%.4f"] * 3 + ["%.5f"] * 3 + ["%d"] * 3)
        np.savetxt(text, self.triangles, fmt="3 %d %d %d")
        return text.getvalue()

    def _normals(self) -> Array:
        """Returns the unit normal at each corner, shape (n, 3): the area-weighted mean over adjacent triangles."""
        a, b, c = (self.points[self.triangles[:, corner]] for corner in range(3))
        across = np.cross(b - a, c - a)
        normals = np.zeros_like(self.points)
        for corner in range(3):
            np.add.at(normals, self.triangles[:, corner], across)
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        return np.divide(normals, length, out=normals, where=length > 0.0)


def models_of(bodies: Iterable[Body]) -> dict[str, ObjectModel]:
    """Returns the models of objects, indexed by object name. Objects with the same shapes and colours share a model.

    Raises:
        InterfaceError: If a mesh cannot be read, or the description of an object has no visual shape.
    """
    kinds: dict[Any, ObjectModel] = {}
    found = {}
    for body in bodies:
        shapes = body_shapes(body)
        kind = tuple(shape._replace(link="") for shape in shapes)
        if kind not in kinds:
            kinds[kind] = _model(len(kinds) + 1, body.name, shapes)
        found[body.name] = kinds[kind]
    return found


def _model(obj_id: int, name: str, shapes: list[BodyShape]) -> ObjectModel:
    try:
        parts = [_triangles(shape) for shape in shapes]
    except (ValueError, OSError) as error:
        raise InterfaceError(f"'{name}' cannot be labelled: {error}") from None
    if not parts:
        raise InterfaceError(f"'{name}' cannot be labelled: it has no visual shape that a file describes")
    rgb = [np.rint(255.0 * np.array(shape.rgba[:3])) for shape in shapes]
    coloured = np.concatenate([np.hstack([part, np.tile(each, (len(part), 1))]) for part, each in zip(parts, rgb)])
    rows, numbers = np.unique(coloured, axis=0, return_inverse=True)
    return ObjectModel(obj_id, name, rows[:, :3], numbers.reshape(-1, 3), rows[:, 3:].astype(np.uint8))


def _triangles(shape: BodyShape) -> Array:
    """Returns the corners of a shape's n triangles in the link frame, shape (3 n, 3) [m]."""
    x, y, z = shape.size
    if shape.kind is ShapeKind.MESH:
        corners = np.concatenate(read_triangles(shape.mesh_file)) * shape.size
    elif shape.kind is ShapeKind.TRIANGLES:
        corners = np.multiply(shape.corners, shape.size)
    else:
        surface = {
            ShapeKind.BOX: lambda: surfaces.box((x / 2.0, y / 2.0, z / 2.0)),
            ShapeKind.SPHERE: lambda: surfaces.capsule(x / 2.0, 0.0),
            ShapeKind.CYLINDER: lambda: surfaces.cylinder(x / 2.0, z),
        }[shape.kind]()
        corners = surface.points[surface.triangles]
    T = matrix_of(*shape.pose_in_link)
    placed: Array = corners.reshape(-1, 3) @ T[:3, :3].T + T[:3, 3]
    return placed


def _diameter(points: Array) -> float:
    """Returns the largest distance between two of the points."""
    try:
        points = points[ConvexHull(points).vertices]
    except QhullError:
        pass  # the points lie in a plane, and are usually few
    return float(pdist(points).max())
