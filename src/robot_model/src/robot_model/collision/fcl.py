"""Distances between collision shapes, measured by hpp-fcl without a simulator; meshes become convex hulls."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from custom_ros_tools.errors import ConfigError, MissingDependency, Problem
from custom_ros_tools.transforms import matrix_of
from robot_model.geometry import Pose, Vector, minus, norm, scaled
from robot_model.model import RobotModel

try:
    import hppfcl
except ImportError:
    raise MissingDependency("hpp-fcl", "./rpbi setup ik") from None

from .shapes import Obstacle, ObstacleKind, collision_shapes
from .solids import ClosestPoints, Solid, balls_of, few_balls

TOUCHING_M = 1e-9
"""Distance between closest points [m] up to which hpp-fcl's normal is used as the direction. At larger distances, the
direction is computed from the points, since the normal may be NaN."""


class Hull(NamedTuple):
    """A convex shape that moves with a frame.

    Attributes:
        frame: Number of the frame, see `LinkFrames`.
        pose: Pose of the shape in the frame, 4 x 4.
        shape: The hpp-fcl object.
        solid: Solid that contains the shape, in the shape's own frame.
    """

    frame: int
    pose: np.ndarray
    shape: Any
    solid: Solid


class FclShapes:
    """Collision shapes of a robot and of obstacles in hpp-fcl, see `Shapes`.

    Args:
        robot: The robot; the files of its collision meshes must exist.

    Attributes:
        links: Names of the links that have a collision shape.

    Raises:
        ConfigError: If a mesh cannot be read.
    """

    def __init__(self, robot: RobotModel) -> None:
        self._robot = robot
        self._hulls = dict[str | int, list[Hull]](hulls_of_links(robot).items())
        self.links = tuple(robot_link for robot_link in robot.links if robot_link in self._hulls)
        self.place(np.zeros(len(robot.joint_names)))

    def place(self, q: np.ndarray) -> None:
        """See `Shapes`."""
        self._frames = self._robot.frames.at(q[None])[0]

    def put(self, number: int, obstacle: Obstacle) -> None:
        """See `Shapes`."""
        self._hulls[number] = [hull_of(obstacle)]

    def move(self, number: int, pose: Pose) -> None:
        """See `Shapes`."""
        self._hulls[number] = [hull._replace(pose=matrix_of(*pose)) for hull in self._hulls[number]]

    def remove(self, number: int) -> None:
        """See `Shapes`."""
        self._hulls.pop(number, None)

    def closest(self, link: str, other: str | int, most_m: float) -> list[ClosestPoints]:
        """See `Shapes`."""
        found = []
        placed = [(hull.shape, transform(self._frames[hull.frame] @ hull.pose)) for hull in self._hulls[other]]
        for hull in self._hulls[link]:
            place = transform(self._frames[hull.frame] @ hull.pose)
            for shape, at in placed:
                result = hppfcl.DistanceResult()
                distance = hppfcl.distance(hull.shape, place, shape, at, hppfcl.DistanceRequest(True), result)
                if distance <= most_m:
                    ends = tuple(result.getNearestPoint1()), tuple(result.getNearestPoint2())
                    way = minus(*ends)
                    apart = norm(way)
                    direction = scaled(1.0 / apart, way) if apart > TOUCHING_M else tuple(result.normal)
                    found.append(ClosestPoints(distance, direction, *ends))
        return found

    def solids_of(self, link: str) -> list[Solid]:
        """See `Shapes`."""
        inverse = np.linalg.inv(self._robot.frames.place(link)[1])
        return [hull.solid.moved(0, inverse @ hull.pose) for hull in self._hulls[link]]

    def solids_of_obstacle(self, number: int) -> list[Solid]:
        """See `Shapes`."""
        return [hull.solid for hull in self._hulls[number]]

    def radius_m(self, link: str, origin: np.ndarray) -> float:
        """See `Shapes`."""
        placed = [hull.solid.moved(0, self._frames[hull.frame] @ hull.pose).balls for hull in self._hulls[link]]
        return max(float((np.linalg.norm(balls[:, :3] - origin, axis=1) + balls[:, 3]).max()) for balls in placed)


def hulls_of_links(robot: RobotModel) -> dict[str, list[Hull]]:
    """Returns the collision shapes of a robot's links, indexed by link name; links without a shape are left out.

    Raises:
        ConfigError: If a mesh cannot be read.
    """
    found = {}
    for link in robot.links:
        frame, pose = robot.frames.place(link)
        try:
            shapes = collision_shapes(robot.document, link)
            hulls = [_hull(*each[:2], each.mesh_file, frame, pose @ each.pose) for each in shapes]
        except (ValueError, OSError) as error:
            raise ConfigError([Problem(robot.urdf_path, f"link '{link}'", str(error))]) from None
        if hulls:
            found[link] = hulls
    return found


def hull_of(obstacle: Obstacle) -> Hull:
    """Returns the shape of an obstacle.

    Raises:
        ValueError: If the obstacle is flat, or its mesh cannot be read.
    """
    pose = matrix_of(*obstacle.pose)
    return _hull(obstacle.kind, obstacle.link_size, obstacle.mesh_file, 0, pose, obstacle.corners)


def _hull(
    kind: ObstacleKind, size: tuple[float, ...], file: str, frame: int, pose: np.ndarray, corners: Sequence[Vector] = ()
) -> Hull:
    if kind in ("mesh", "points"):
        shape, points = _convex(tuple(corners) if kind == "points" else mesh_corners(file, size))
        return Hull(frame, pose, shape, Solid(0, few_balls(points)))
    if kind == "plane":
        below = hppfcl.Halfspace(np.array((0.0, 0.0, 1.0)), 0.0)
        return Hull(frame, pose, below, Solid(0, np.zeros((1, 4)), np.array((0.0, 0.0, 1.0))))
    return Hull(frame, pose, primitive(kind, size), Solid(0, balls_of(kind, size)))


def primitive(kind: ObstacleKind, size: tuple[float, ...]) -> Any:
    """Makes an hpp-fcl box, sphere, cylinder or capsule; for `size`, see `CollisionShape`."""
    if kind == "box":
        return hppfcl.Box(*size)
    if kind == "sphere":
        return hppfcl.Sphere(size[0])
    return (hppfcl.Cylinder if kind == "cylinder" else hppfcl.Capsule)(size[1], size[0])


def transform(pose: np.ndarray) -> Any:
    """Converts a pose, 4 x 4, to hpp-fcl's type."""
    return hppfcl.Transform3f(pose[:3, :3], pose[:3, 3])


def load_mesh(file: str, scale: tuple[float, ...]) -> Any:
    """Reads a mesh with hpp-fcl.

    Args:
        file: Path of the mesh.
        scale: Factors along x, y and z.

    Raises:
        ValueError: If the mesh cannot be read.
    """
    try:
        return hppfcl.MeshLoader(hppfcl.NODE_TYPE.BV_OBBRSS).load(file, np.array(scale))
    except (RuntimeError, ValueError) as error:
        raise ValueError(f"mesh {file}: {error}") from None


@lru_cache(maxsize=64)
def mesh_corners(file: str, scale: tuple[float, ...]) -> tuple[Vector, ...]:
    """Reads a mesh, and returns its scaled corners [m].

    Raises:
        ValueError: If the mesh cannot be read, or a corner is not finite.
    """
    corners = np.array(load_mesh(file, scale).vertices())
    if not len(corners) or not np.isfinite(corners).all():
        raise ValueError(f"mesh {file}: expected finite corners")
    return tuple(map(tuple, corners.tolist()))


@lru_cache(maxsize=64)
def _convex(corners: tuple[Vector, ...]) -> tuple[Any, list[Vector]]:
    """Returns the convex hull of points as an hpp-fcl object, and the hull's corners.

    Raises:
        ValueError: If the points are in one plane.
    """
    try:
        hull = ConvexHull(np.array(corners))
    except QhullError:
        raise ValueError("expected a shape that is not flat") from None
    number = {int(vertex): i for i, vertex in enumerate(hull.vertices)}
    points, triangles = hppfcl.StdVec_Vec3f(), hppfcl.StdVec_Triangle()
    for vertex in hull.vertices:
        points.append(hull.points[vertex])
    for simplex, outward in zip(hull.simplices, hull.equations[:, :3]):
        a, b, c = hull.points[simplex]
        ordered = simplex if np.cross(b - a, c - a) @ outward > 0.0 else simplex[::-1]
        triangles.append(hppfcl.Triangle(*(number[int(vertex)] for vertex in ordered)))
    return hppfcl.Convex(points, triangles), [corners[vertex] for vertex in hull.vertices]
