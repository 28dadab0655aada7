"""Shapes for collisions: those of a robot's links, and obstacles around the robot."""

from __future__ import annotations

from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from custom_ros_tools.transforms import matrix_of, quat_of
from robot_model.geometry import Pose, Vector
from robot_model.urdf.document import UrdfDocument
from robot_model.urdf.elements import Element, read_vector
from robot_model.urdf.files import found_mesh

LinkShapeKind = Literal["box", "sphere", "cylinder", "capsule", "mesh"]
ObstacleKind = Literal["box", "sphere", "cylinder", "capsule", "plane", "mesh", "points"]


class CollisionShape(NamedTuple):
    """A collision shape of a link.

    Attributes:
        kind: Its kind; the axis of cylinders and capsules is z.
        size: Lengths x, y, z of a box; radius of a sphere; length and radius of a cylinder, or of a capsule without its
            round ends [m]; factors x, y, z of a mesh.
        pose: Its pose in the link, 4 x 4.
        mesh_file: File of a mesh.
    """

    kind: LinkShapeKind
    size: tuple[float, ...]
    pose: NDArray[np.float64]
    mesh_file: str = ""


class Obstacle(NamedTuple):
    """A convex shape of the environment that a robot must not touch.

    Attributes:
        name: Its name, for messages; shapes of one body may share it.
        kind: Its kind. The axis of a cylinder or capsule is z. A plane is the half-space below z = 0. A mesh and points
            are replaced by their convex hulls.
        size: Extents along x, y and z, as in the scale of a marker [m]; that of a capsule along z is without its round
            ends. Factors x, y, z of a mesh.
        pose: Its pose in the robot's root link.
        mesh_file: File of a mesh.
        corners: The points [m].
    """

    name: str
    kind: ObstacleKind
    size: Vector
    pose: Pose = Pose()
    mesh_file: str = ""
    corners: tuple[Vector, ...] = ()

    @property
    def shape(self) -> tuple[Any, ...]:
        """Its attributes without name and pose."""
        return self.kind, self.size, self.mesh_file, self.corners

    @property
    def link_size(self) -> tuple[float, ...]:
        """Its size as a `CollisionShape` of the same kind has it."""
        x, y, z = self.size
        if self.kind == "sphere":
            return (max(x, y, z) / 2.0,)
        return (z, max(x, y) / 2.0) if self.kind in ("cylinder", "capsule") else self.size


def collision_shapes(document: UrdfDocument, link: str) -> list[CollisionShape]:
    """Returns the collision shapes of a link in the order of the file, without kinds that PyBullet does not support.

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
        kind: LinkShapeKind = "cylinder" if geometry.tag == "cylinder" else "capsule"
        return CollisionShape(kind, numbers("length", "radius"), pose)
    return None
