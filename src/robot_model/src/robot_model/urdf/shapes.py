"""Collision shapes of links."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from custom_ros_tools.transforms import matrix_of, quat_of

from .document import UrdfDocument
from .elements import Element, read_vector
from .files import found_mesh

ShapeKind = Literal["box", "sphere", "cylinder", "capsule", "mesh"]


class CollisionShape(NamedTuple):
    """A collision shape of a link.

    Attributes:
        kind: Its kind; the axis of cylinders and capsules is z.
        size: Lengths x, y, z of a box; radius of a sphere; length and radius of a cylinder, or of a capsule without its
            round ends [m]; factors x, y, z of a mesh.
        pose: Its pose in the link, 4 x 4.
        mesh_file: File of a mesh.
    """

    kind: ShapeKind
    size: tuple[float, ...]
    pose: NDArray[np.float64]
    mesh_file: str = ""


def collision_shapes(document: UrdfDocument, link: str) -> list[CollisionShape]:
    """Returns the collision shapes of a link in the order of the file; kinds that PyBullet does not support are left
    out.

    Raises:
        ConfigError: If a mesh belongs to an unknown package or does not exist.
        OSError: If a mesh does not exist.
        ValueError: If a size is no number.
    """
    return [
        shape
        for element in document.root.iterfind("link")
        if element.get("name") == link
        for collision in element.iterfind("collision")
        for geometry in collision.iterfind("geometry/*")
        if (shape := _shape(geometry, _pose(collision), document)) is not None
    ]


def _pose(collision: Element) -> NDArray[np.float64]:
    xyz, rpy = (read_vector(collision, "origin", key, "0 0 0") for key in ("xyz", "rpy"))
    return matrix_of(xyz, quat_of(rpy))


def _shape(geometry: Element, pose: NDArray[np.float64], document: UrdfDocument) -> CollisionShape | None:
    def numbers(*keys: str) -> tuple[float, ...]:
        return tuple(
            float(word) for key in keys for word in geometry.get(key, "1 1 1" if key == "scale" else "").split()
        )

    if geometry.tag == "mesh":
        file = str(found_mesh(geometry.get("filename", ""), document.source))
        scale = numbers("scale")
        return CollisionShape("mesh", scale if len(scale) == 3 else (scale[0],) * 3, pose, file)
    if geometry.tag == "box":
        return CollisionShape("box", numbers("size"), pose)
    if geometry.tag == "sphere":
        return CollisionShape("sphere", numbers("radius"), pose)
    if geometry.tag in ("cylinder", "capsule"):
        kind: ShapeKind = "cylinder" if geometry.tag == "cylinder" else "capsule"
        return CollisionShape(kind, numbers("length", "radius"), pose)
    return None
