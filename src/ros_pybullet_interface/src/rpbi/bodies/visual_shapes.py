"""Visible shapes of bodies, and their poses."""

import enum
import math
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import pybullet

from robot_model.geometry import Quaternion, Vector
from rpbi.control.pose_follower import TrackedBase
from rpbi.geometry import Pose
from rpbi.sensors.link_pose import LinkPoseSensor
from rpbi.sensors.sensor import Sensor

from . import Body
from .shape_object import ShapeObject

PLANE_SIZE_M = 40.0
PLANE_THICKNESS_M = 0.001
"""Thickness [m] of the box that shows an infinite plane; the top of the box is the plane."""


class ShapeKind(enum.Enum):
    """Kind of a visual shape, on which the meaning of some fields of `BodyShape` depends."""

    BOX = enum.auto()
    SPHERE = enum.auto()
    CYLINDER = enum.auto()
    MESH = enum.auto()
    TRIANGLES = enum.auto()


class BodyShape(NamedTuple):
    """One visual shape of a link.

    Attributes:
        link_index: PyBullet's index of the link, -1 for the root.
        link: Name of the link.
        kind: Kind of the shape; the axis of a cylinder is z.
        size: Extents along x, y and z [m]; for MESH and TRIANGLES, scale factors along x, y and z.
        pose_in_link: Pose of the shape in the link's URDF frame.
        rgba: Colour and opacity, each from 0 to 1.
        mesh_file: Mesh file of a MESH.
        is_textured: Whether a MESH has a texture, whose colours are multiplied with `rgba`.
        corners: Corners of TRIANGLES [m], three for each triangle.
    """

    link_index: int
    link: str
    kind: ShapeKind
    size: Vector
    pose_in_link: Pose
    rgba: tuple[float, float, float, float]
    mesh_file: str = ""
    is_textured: bool = False
    corners: tuple[Vector, ...] = ()


def body_shapes(body: Body) -> list[BodyShape]:
    """Returns the visual shapes of a body; for a soft body, an empty list, since its surface changes.

    A capsule is returned as a cylinder and two spheres. PyBullet gives the pose of a visual shape in the URDF frame of
    the link, not in the inertial frame. Only the simulation thread may call this function.
    """
    if body.is_soft:
        return []  # its surface has a sensor of its own
    rows = body.pb.getVisualShapeData(body.body_id, pybullet.VISUAL_SHAPE_DATA_TEXTURE_UNIQUE_IDS)
    return [part for data in rows for part in _parts(body, data)]


def link_pose(body: Body, link_index: int) -> Pose:
    """Returns the pose of a link's URDF frame in the world frame; only the simulation thread may call this function.

    Args:
        link_index: PyBullet's index of the link, -1 for the root.
    """
    if link_index == -1:
        return body.base_pose()
    return Pose(*body.pb.getLinkState(body.body_id, link_index, computeForwardKinematics=1)[4:6])


def _parts(body: Body, data: Sequence[Any]) -> list[BodyShape]:
    """Converts a row of PyBullet's `getVisualShapeData` to shapes."""
    _, index, kind, size, file, position, quat, rgba, texture = data
    link, frame = body.link_name(index), Pose(position, quat)
    visual = body.visual if isinstance(body, ShapeObject) else None  # from the object's own file

    def shape(kind: ShapeKind, size: Vector, pose: Pose = frame, **more: Any) -> BodyShape:
        return BodyShape(index, link, kind, size, pose, rgba, **more)

    if kind == pybullet.GEOM_BOX:
        return [shape(ShapeKind.BOX, size)]
    if kind == pybullet.GEOM_SPHERE:
        return [shape(ShapeKind.SPHERE, _cube(2 * size[0]))]
    if kind in (pybullet.GEOM_CYLINDER, pybullet.GEOM_CAPSULE):
        length, diameter = size[0], 2 * size[1]
        cylinder = shape(ShapeKind.CYLINDER, (diameter, diameter, length))
        if kind == pybullet.GEOM_CYLINDER:
            return [cylinder]
        ends = [frame @ Pose((0.0, 0.0, z)) for z in (length / 2, -length / 2)]
        return [cylinder, *(shape(ShapeKind.SPHERE, _cube(diameter), end) for end in ends)]
    if kind == pybullet.GEOM_PLANE:
        # PyBullet does not report the normal of a plane; for a URDF, z is assumed
        normal = visual.planeNormal if visual is not None else None
        surface = frame @ Pose(quat_xyzw=turned_to(normal or (0.0, 0.0, 1.0)))
        middle = surface @ Pose((0.0, 0.0, -PLANE_THICKNESS_M / 2))
        return [shape(ShapeKind.BOX, (PLANE_SIZE_M, PLANE_SIZE_M, PLANE_THICKNESS_M), middle)]
    if file:
        return [shape(ShapeKind.MESH, size, mesh_file=file.decode(), is_textured=texture >= 0)]
    if visual is None or not visual.vertices or not visual.indices:
        return []
    return [shape(ShapeKind.TRIANGLES, size, corners=tuple(visual.vertices[i] for i in visual.indices))]


def _cube(edge_m: float) -> Vector:
    return edge_m, edge_m, edge_m


def turned_to(normal: Vector) -> Quaternion:
    """Returns the quaternion of the shortest rotation that turns the z axis to a given direction.

    Before normalisation, the quaternion's vector part is the cross product of z axis and direction, and w is
    `1 + cos(angle)`.
    """
    length = math.hypot(*normal)
    x, y, z = (component / length for component in normal)
    if z < -1.0 + 1e-9:
        return 1.0, 0.0, 0.0, 0.0
    norm = math.hypot(x, y, 1.0 + z)
    return -y / norm, x / norm, 0.0, (1.0 + z) / norm


def link_frame(body: Body, sensors: Iterable[Sensor], link: str) -> str | None:
    """Returns the name of a link's TF frame, such as `rpbi/NAME/LINK`; None if the link is not on TF.

    If this node publishes only the root link of a robot, robot_state_publisher is expected to publish the other links.
    """
    for sensor in sensors:
        if isinstance(sensor, LinkPoseSensor):
            if link == body.root_link:
                return sensor.root_frame
            if sensor.root_frame == f"rpbi/{body.name}/{body.root_link}":
                return f"rpbi/{body.name}/{link}"
    return None


def followed_frame(body: Body) -> str | None:
    """Returns the TF frame that a `ShapeObject` always follows.

    Returns None if there is no such frame, if physics moves the body while the frame is out of date, or for other types
    of bodies.
    """
    if body.object_tf is None or not isinstance(body, ShapeObject) or isinstance(body.pose_follower, TrackedBase):
        return None
    return body.object_tf.tf_id
