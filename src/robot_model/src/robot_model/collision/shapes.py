"""Collision shapes of a robot's links, and obstacles around the robot."""

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
        kind: Kind of the shape. The axis of cylinders and capsules is z.
        size: Box: lengths along x, y and z [m]. Sphere: radius [m]. Cylinder: length and radius [m]. Capsule: length
            without the round ends, and radius [m]. Mesh: scale factors along x, y and z.
        pose: Pose of the shape in the link, 4 x 4.
        mesh_file: Path of the mesh; empty for other kinds.
    """

    kind: LinkShapeKind
    size: tuple[float, ...]
    pose: NDArray[np.float64]
    mesh_file: str = ""


class Obstacle(NamedTuple):
    """A convex shape of the environment that a robot must not touch.

    Attributes:
        name: Name of the obstacle in messages. Several obstacles that represent one body may have the same name.
        kind: Kind of the obstacle. The axis of a cylinder or capsule is z. A plane is the half-space below z = 0. A
            mesh, or a set of points, is replaced by its convex hull.
        size: Extents along x, y and z, like the field `scale` of a ROS marker [m]. The z extent of a capsule excludes
            the round ends. Mesh: scale factors along x, y and z.
        pose: Pose of the obstacle in the robot's root frame.
        mesh_file: Path of the mesh; empty for other kinds.
        corners: The points of kind `points`, in the obstacle's frame [m].
    """

    name: str
    kind: ObstacleKind
    size: Vector
    pose: Pose = Pose()
    mesh_file: str = ""
    corners: tuple[Vector, ...] = ()

    @property
    def shape(self) -> tuple[Any, ...]:
        """The attributes other than name and pose. Two obstacles with equal tuples have the same shape."""
        return self.kind, self.size, self.mesh_file, self.corners

    @property
    def link_size(self) -> tuple[float, ...]:
        """The size of the obstacle in the convention of `CollisionShape.size`."""
        x, y, z = self.size
        if self.kind == "sphere":
            return (max(x, y, z) / 2.0,)
        return (z, max(x, y) / 2.0) if self.kind in ("cylinder", "capsule") else self.size


def collision_shapes(document: UrdfDocument, link: str) -> list[CollisionShape]:
    """Returns a link's collision shapes in the file's order, without shapes whose kind is not a `LinkShapeKind`.

    Raises:
        ConfigError: If a mesh with a `package://` path belongs to an unknown package or does not exist.
        OSError: If a mesh with another path does not exist.
        ValueError: If a size is not a number.
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
