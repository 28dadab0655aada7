"""The pairs of shapes in a scene that a group of joints moves relative to each other, as a model of pinocchio."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from custom_ros_tools.errors import ConfigError, MissingDependency, Problem
from custom_ros_tools.transforms import matrix_of
from robot_model.collision.distances import LinkDistances
from robot_model.collision.shapes import Obstacle
from robot_model.frames import origin_of
from robot_model.joint_map import AffineMap
from robot_model.model import RobotModel
from safe_robot.checks.self_collision import pairs_that_may_meet

try:
    import pinocchio as pin
except ImportError:
    raise MissingDependency("pinocchio", "./rpbi setup planning") from None

from robot_model.collision.fcl import FclShapes, Hull, hull_of, hulls_of_links

from .group import Array, Group
from .scene import PlanningScene
from .scene_robot import SceneRobot

NEAR_M = 1e-3
"""Pairs of links that are nearly always nearer than this beyond the padding are near by construction, and left out."""


class MovedShape(NamedTuple):
    """A shape in the model; `robot` is -1 for shapes that the group does not move."""

    name: str
    robot: int
    link: str
    hull: Hull


_pairs: dict[tuple[str, tuple[str, ...], float], list[tuple[str, str]]] = {}
"""Pairs of links that may meet, by URDF, driven joints and padding."""
_hulls: dict[tuple[str, tuple[str, ...]], dict[str, list[Hull]]] = {}


def _self_pairs(robot: SceneRobot, padding_m: float) -> list[tuple[str, str]]:
    key = robot.model.urdf_path, robot.model.joint_names, padding_m
    if key not in _pairs:
        distances = LinkDistances(robot.model, FclShapes(robot.model))
        _pairs[key] = pairs_that_may_meet(robot.model, distances, padding_m + NEAR_M)
    return [pair for pair in _pairs[key] if frozenset(pair) not in robot.never_checked]


def _hulls_of(model: RobotModel) -> dict[str, list[Hull]]:
    key = model.urdf_path, model.joint_names
    if key not in _hulls:
        _hulls[key] = hulls_of_links(model)
    return _hulls[key]


class ScenePairs:
    """Shapes of a scene, and their pairs that may not meet and that a group of joints moves relative to each other.

    Args:
        scene: The scene.
        group: The joints that move.

    Attributes:
        first: Number of the first shape of each pair.
        second: Number of the second shape of each pair.
        padding: Least allowed distance of each pair [m].
        reach: For each pair, n upper bounds on the change of the distance per rad or m of each joint.

    Raises:
        ConfigError: If a mesh cannot be read.
        ValueError: If a shape of a body is invalid.
    """

    def __init__(self, scene: PlanningScene, group: Group) -> None:
        self.scene, self.group = scene, group
        self.model, self.shapes = pin.Model(), list[MovedShape]()
        self.geometry = pin.GeometryModel()
        self._joint_of_link: dict[tuple[int, str], tuple[int, Array]] = {}
        self.joint_maps = [self._add_joints(r, robot) for r, robot in enumerate(group.robots)]
        """For each robot, the map from its driven positions to the joints of the model."""
        self._add_shapes()
        self._add_pairs()

    def _add_joints(self, r: int, robot: SceneRobot) -> AffineMap:
        """Adds the moving joints of a robot; returns the map from the robot's driven positions to these joints."""
        ids = {robot.model.root: (0, matrix_of(*robot.base))}
        moving, waiting = list[str](), list(robot.model.all_joints.values())
        while waiting:  # parents come first
            joint = next(each for each in waiting if each.parent in ids)
            waiting.remove(joint)
            parent, pose = ids[joint.parent]
            place = pose @ origin_of(joint)
            if not joint.is_moving:
                ids[joint.child] = parent, place
                continue
            kind = pin.JointModelRevoluteUnaligned if joint.is_revolute else pin.JointModelPrismaticUnaligned
            at = pin.SE3(place[:3, :3], place[:3, 3])
            number = self.model.addJoint(parent, kind(np.array(joint.axis)), at, f"{r}/{joint.name}")
            ids[joint.child] = number, np.eye(4)
            moving.append(joint.name)
        self._joint_of_link.update({(r, link): place for link, place in ids.items()})
        return robot.model.map_to(moving)

    def _add_shapes(self) -> None:
        scene, mine = self.scene, {robot.name: r for r, robot in enumerate(self.group.robots)}
        for r, robot in enumerate(self.group.robots):
            for link, hulls in _hulls_of(robot.model).items():
                frame, in_frame = robot.model.frames.place(link)
                for hull in hulls:
                    in_link = np.linalg.inv(in_frame) @ hull.pose
                    self._add(MovedShape(f"{robot.name}/{link}", r, link, hull._replace(pose=in_link)))
        for name, robot in scene.robots.items():
            if name in mine:
                continue
            poses = dict(zip(robot.model.frames.links, robot.model.frames.of_links(robot.positions[None])[0]))
            for link, hulls in _hulls_of(robot.model).items():
                _, in_frame = robot.model.frames.place(link)
                for hull in hulls:
                    place = matrix_of(*robot.base) @ poses[link] @ np.linalg.inv(in_frame) @ hull.pose
                    self._add(MovedShape(f"{name}/{link}", -1, link, hull._replace(pose=place)))
        for body, shapes in scene.bodies.items():
            held = scene.held.get(body)
            for shape in shapes:
                hull = _hull_of(body, shape)
                if held is not None and held.robot in mine:
                    hull = hull._replace(pose=matrix_of(*held.pose) @ hull.pose)
                    self._add(MovedShape(body, mine[held.robot], held.link, hull))
                else:
                    self._add(MovedShape(body, -1, "", hull))

    def _add(self, shape: MovedShape) -> None:
        joint, place = self._joint_of_link[shape.robot, shape.link] if shape.robot >= 0 else (0, np.eye(4))
        pose = place @ shape.hull.pose
        number = len(self.shapes)
        at = pin.SE3(pose[:3, :3], pose[:3, 3])
        self.geometry.addGeometryObject(pin.GeometryObject(str(number), joint, shape.hull.shape, at))
        self.shapes.append(shape)

    def _add_pairs(self) -> None:
        scene, group = self.scene, self.group
        allowed, links = scene.allowed, [list(_hulls_of(robot.model)) for robot in group.robots]
        own = [
            {frozenset(pair) for pair in _self_pairs(robot, scene.self_padding_m)} if links[r] else set()
            for r, robot in enumerate(group.robots)
        ]
        reach = [self._reach_of(shape) for shape in self.shapes]
        rows: list[tuple[int, int, float, Array]] = []
        for i, a in enumerate(self.shapes):
            for j in range(i + 1, len(self.shapes)):
                b = self.shapes[j]
                if a.name == b.name or (a.robot < 0 and b.robot < 0) or _is_allowed(allowed, a.name, b.name):
                    continue
                padding_m = scene.padding_m
                if a.robot == b.robot:
                    bodies = [each for each in (a, b) if each.name in scene.bodies]
                    if not bodies and frozenset((a.link, b.link)) not in own[a.robot]:
                        continue
                    padding_m = scene.self_padding_m
                    if len(bodies) == 2 and a.link == b.link:
                        continue
                    if any(
                        o.name not in scene.bodies and o.link in scene.held[body.name].touching
                        for body, o in ((a, b), (b, a))
                        if body.name in scene.bodies
                    ):
                        continue
                    relative = self._reach_between(a, b) + self._reach_between(b, a)
                else:
                    relative = reach[i] + reach[j]
                if relative.any():
                    rows.append((i, j, padding_m, relative))
        for i, j, _, _ in rows:
            self.geometry.addCollisionPair(pin.CollisionPair(i, j))
        n = len(group.joint_names)
        self.first = np.array([row[0] for row in rows], int)
        self.second = np.array([row[1] for row in rows], int)
        self.padding = np.array([row[2] for row in rows])
        self.reach = np.array([row[3] for row in rows]).reshape(-1, n)

    def _radius(self, shape: MovedShape) -> float:
        """Returns the distance from the origin of the shape's link to the farthest point of the shape [m]."""
        balls = shape.hull.solid.moved(0, shape.hull.pose).balls
        return float((np.linalg.norm(balls[:, :3], axis=1) + balls[:, 3]).max())

    def _reach_of(self, shape: MovedShape) -> Array:
        reach = np.zeros(len(self.group.joint_names))
        if shape.robot >= 0:
            model = self.group.robots[shape.robot].model
            reach[self.group.slices[shape.robot]] = model.reach(shape.link, self._radius(shape))[
                self.group.columns[shape.robot]
            ]
        return reach

    def _reach_between(self, shape: MovedShape, other: MovedShape) -> Array:
        reach = np.zeros(len(self.group.joint_names))
        model = self.group.robots[shape.robot].model
        reach[self.group.slices[shape.robot]] = model.reach(shape.link, self._radius(shape), other.link)[
            self.group.columns[shape.robot]
        ]
        return reach


def _is_allowed(allowed: set[frozenset[str]], a: str, b: str) -> bool:
    if not allowed:
        return False
    return any(frozenset((x, y)) in allowed for x in {a, a.split("/")[0]} for y in {b, b.split("/")[0]})


def _hull_of(body: str, shape: Obstacle) -> Hull:
    try:
        return hull_of(shape)
    except ValueError as error:
        raise ConfigError([Problem(shape.mesh_file, f"body '{body}'", str(error))]) from None
