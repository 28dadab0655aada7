"""Collision checks of configurations, and proofs that whole motions are free.

Pinocchio and hpp-fcl check all pairs of shapes in one configuration. A motion is proven by distances: between two
configurations, the distance of a pair changes at most by the pair's reach times the motion of the joints, see
`RobotModel.reach`. If the distances at both ends together exceed this change, the pair is free in between. Otherwise,
the interval is divided (Schwarzer, Saha and Latombe, 2005, Adaptive dynamic collision checking).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

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

from .group import Array
from .group import Group as Group
from .scene import PlanningScene, SceneRobot

SMALLEST_STEP = 1e-5
"""Motion of a joint [rad or m] below which an interval is no longer divided: it counts as not free."""
NEAR_M = 1e-3
"""Pairs of links that are nearly always nearer than this beyond the padding are near by construction, and left out."""
ROUNDING_M = 1e-6
"""Error of computed distances [m]."""
FAR_M = 0.15
"""Change of a distance [m] above which an interval is divided before distances are measured exactly."""
TRIAL_STEP = 0.25
"""Motion of a joint [rad or m] between two configurations that are checked before a motion is proven, since most
motions that are not free are found so."""
MAX_ROWS = 200_000
"""Largest number of pairs and intervals of one proof; a motion that needs more counts as not free."""


class Meeting(NamedTuple):
    """Two shapes that are nearer to each other than allowed.

    Attributes:
        first: Name of the first body, or `robot/link`.
        second: The same of the second body.
        distance_m: Distance, negative for shapes that penetrate each other [m].
        padding_m: Least allowed distance [m].
    """

    first: str
    second: str
    distance_m: float
    padding_m: float

    def __str__(self) -> str:
        if self.distance_m < 0.0:
            return f"'{self.first}' and '{self.second}' penetrate each other by {-1e3 * self.distance_m:.1f} mm"
        return (
            f"'{self.first}' and '{self.second}' are {1e3 * self.distance_m:.1f} mm apart, "
            f"{1e3 * self.padding_m:.1f} mm are required"
        )


class Margin(Protocol):
    """A condition on configurations that a whole motion has to keep, such as a path constraint.

    Attributes:
        reach: n upper bounds on the change of the margin per rad or m of each joint.
    """

    reach: Array

    def margins(self, q: Array) -> Array:
        """Returns the margins in k configurations, shape (k,); a negative margin is not allowed."""


class JointMotion(Protocol):
    """A motion of n joints from time 0 to `duration`."""

    @property
    def duration(self) -> float:
        """Duration of the motion."""

    def at(self, times: Array) -> Array:
        """Returns the positions at k times, k x n [rad or m]."""

    def variation(self, start: Array, end: Array) -> Array:
        """Returns upper bounds on the joint motion (total variation) between k pairs of times, k x n [rad or m]."""


class StraightMotion:
    """The straight motion from one configuration to another, from time 0 to 1."""

    @property
    def duration(self) -> float:
        """See `JointMotion`."""
        return 1.0

    def __init__(self, start: Array, end: Array) -> None:
        self._start, self._change = start, end - start

    def at(self, times: Array) -> Array:
        """See `JointMotion`."""
        q: Array = self._start + times[:, None] * self._change
        return q

    def variation(self, start: Array, end: Array) -> Array:
        """See `JointMotion`."""
        motion: Array = (end - start)[:, None] * np.abs(self._change)
        return motion


class _Shape(NamedTuple):
    """A shape in the collision model; `robot` is -1 for shapes that the group does not move."""

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


class CollisionModel:
    """Checks configurations of a group of joints in a scene, and proves motions.

    Pairs of shapes that the group cannot move relative to each other are left out.

    Args:
        scene: The scene; later changes of poses are taken by `update`.
        group: The joints that move.
        margins: Further conditions.

    Raises:
        ConfigError: If a mesh cannot be read.
        ValueError: If a shape of a body is invalid.
    """

    def __init__(self, scene: PlanningScene, group: Group, margins: Sequence[Margin] = ()) -> None:
        self.scene, self.group, self.margins = scene, group, list(margins)
        self.version = scene.version
        self.model, self.shapes = pin.Model(), list[_Shape]()
        self.geometry = pin.GeometryModel()
        self._joint_of_link: dict[tuple[int, str], tuple[int, Array]] = {}
        self._maps = [self._add_joints(r, robot) for r, robot in enumerate(group.robots)]
        self._add_shapes()
        self._add_pairs()
        self._data, self._placed = self.model.createData(), pin.GeometryData(self.geometry)
        self.checks = 0
        self.proofs = 0
        self.update()

    # --- Making the model

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
                    self._add(_Shape(f"{robot.name}/{link}", r, link, hull._replace(pose=in_link)))
        for name, robot in scene.robots.items():
            if name in mine:
                continue
            poses = dict(zip(robot.model.frames.links, robot.model.frames.of_links(robot.positions[None])[0]))
            for link, hulls in _hulls_of(robot.model).items():
                _, in_frame = robot.model.frames.place(link)
                for hull in hulls:
                    place = matrix_of(*robot.base) @ poses[link] @ np.linalg.inv(in_frame) @ hull.pose
                    self._add(_Shape(f"{name}/{link}", -1, link, hull._replace(pose=place)))
        for body, shapes in scene.bodies.items():
            held = scene.held.get(body)
            for shape in shapes:
                hull = _hull_of(body, shape)
                if held is not None and held.robot in mine:
                    hull = hull._replace(pose=matrix_of(*held.pose) @ hull.pose)
                    self._add(_Shape(body, mine[held.robot], held.link, hull))
                else:
                    self._add(_Shape(body, -1, "", hull))

    def _add(self, shape: _Shape) -> None:
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
        self._own_padding = self.padding
        self.use(self.group, self.margins)

    def use(self, group: Group, margins: Sequence[Margin]) -> None:
        """Replaces the margins, and the group by another one with the same joints."""
        self.group, self.margins = group, list(margins)
        self._all_reach = np.concatenate([self.reach, *(each.reach[None] for each in self.margins)])

    def _radius(self, shape: _Shape) -> float:
        """Returns the distance from the origin of the shape's link to the farthest point of the shape [m]."""
        balls = shape.hull.solid.moved(0, shape.hull.pose).balls
        return float((np.linalg.norm(balls[:, :3], axis=1) + balls[:, 3]).max())

    def _reach_of(self, shape: _Shape) -> Array:
        reach = np.zeros(len(self.group.joint_names))
        if shape.robot >= 0:
            model = self.group.robots[shape.robot].model
            reach[self.group.slices[shape.robot]] = model.reach(shape.link, self._radius(shape))[
                self.group.columns[shape.robot]
            ]
        return reach

    def _reach_between(self, shape: _Shape, other: _Shape) -> Array:
        reach = np.zeros(len(self.group.joint_names))
        model = self.group.robots[shape.robot].model
        reach[self.group.slices[shape.robot]] = model.reach(shape.link, self._radius(shape), other.link)[
            self.group.columns[shape.robot]
        ]
        return reach

    # --- Poses

    def update(self) -> None:
        """Takes the present poses of bodies, and the scene's paddings again."""
        places = np.empty((len(self.shapes), 4, 4))
        for i, shape in enumerate(self.shapes):
            pose = shape.hull.pose
            if shape.robot < 0 and shape.name in self.scene.bodies:
                pose = matrix_of(*self.scene.body_pose(shape.name)) @ pose
                self.geometry.geometryObjects[i].placement = pin.SE3(pose[:3, :3], pose[:3, 3])
            places[i] = pose
        self._local = places
        boxes = [_ball_and_box(shape.hull) for shape in self.shapes]
        self._middle, self._half = (np.array([box[i] for box in boxes]).reshape(-1, 3) for i in (0, 1))
        self._radii = np.array([radius for _, _, radius in boxes])
        self._links: list[tuple[int, Array, Array, Array]] = []
        for r, robot in enumerate(self.group.robots):
            which = [i for i, shape in enumerate(self.shapes) if shape.robot == r]
            frames = [robot.model.frames.place(self.shapes[i].link) for i in which]
            local = np.array([in_frame @ places[i] for i, (_, in_frame) in zip(which, frames)]).reshape(-1, 4, 4)
            self._links.append((r, np.array(which, int), np.array([frame for frame, _ in frames], int), local))
        self.set_paddings(self._own_padding)

    def set_paddings(self, padding: Array) -> None:
        """Sets the least allowed distance of each pair, shape (number of pairs,) [m]."""
        self.padding = padding
        for request, each in zip(self._placed.collisionRequests, padding.tolist()):
            request.security_margin = each
        self._all_padding = np.concatenate([padding, np.zeros(len(self.margins))])

    @property
    def is_lowered(self) -> bool:
        """Whether a padding is less than that of the scene."""
        return bool((self.padding < self._own_padding).any())

    def _places(self, q: Array) -> Array:
        """Returns the poses of all shapes in the world in k configurations, k x shapes x 4 x 4."""
        places = np.repeat(self._local[None], len(q), axis=0)
        for r, which, frames, local in self._links:
            robot = self.group.robots[r]
            at = robot.model.frames.at(self.group.full(q, r)).take(frames, axis=1)
            places[:, which] = matrix_of(*robot.base) @ at @ local
        return places

    def _positions(self, q: Array) -> Array:
        """Returns the positions of all joints of the model in one configuration."""
        joints: Array = np.concatenate([to(self.group.full(q[None], r)[0]) for r, to in enumerate(self._maps)])
        return joints

    # --- One configuration

    def is_free(self, q: Array) -> bool:
        """Returns whether a configuration keeps all paddings, margins and position limits."""
        if (q < self.group.lower - 1e-9).any() or (q > self.group.upper + 1e-9).any():
            return False
        if any(margin.margins(q[None])[0] < 0.0 for margin in self.margins):
            return False
        self.checks += 1
        return not pin.computeCollisions(self.model, self._data, self.geometry, self._placed, self._positions(q), True)

    def distances(self, q: Array, pairs: Sequence[int] | None = None) -> Array:
        """Returns the distances of pairs of shapes in one configuration [m]; by default those of all pairs."""
        pin.updateGeometryPlacements(self.model, self._data, self.geometry, self._placed, self._positions(q))
        which = range(len(self.first)) if pairs is None else pairs
        return (
            np.array([pin.computeDistance(self.geometry, self._placed, int(i)).min_distance for i in which])
            - ROUNDING_M
        )

    def meetings(self, q: Array) -> list[Meeting]:
        """Returns the shapes that are too near to each other in a configuration, the nearest first."""
        found = dict[frozenset[str], Meeting]()
        for i, distance in enumerate(self.distances(q).tolist()):
            if distance < self.padding[i]:
                a, b = self.shapes[self.first[i]].name, self.shapes[self.second[i]].name
                if (old := found.get(frozenset((a, b)))) is None or distance < old.distance_m:
                    found[frozenset((a, b))] = Meeting(a, b, distance, float(self.padding[i]))
        return sorted(found.values(), key=lambda each: each.distance_m)

    def first_contact(self, path: Array) -> tuple[int, Meeting] | None:
        """Checks a path of straight parts against the present poses.

        Args:
            path: Waypoints, m x n [rad or m].

        Returns:
            The number of the first waypoint after a part that is not free, and two shapes that are too near; None for a
            free path.
        """
        for i, q in enumerate(path):
            before = path[max(i - 1, 0)]
            if (share := self.first_unproven(StraightMotion(before, q))) is not None:
                at = before + share * (q - before)
                near = self.meetings(at) or self.meetings(q)
                if near:
                    return i, near[0]
                return i, Meeting("", "", 0.0, 0.0)
        return None

    # --- Proofs

    def proves(self, motion: JointMotion) -> bool:
        """Returns whether a motion is proven to keep all paddings and margins at all times."""
        return self.first_unproven(motion) is None

    def edge(self, start: Array, end: Array) -> bool:
        """Returns whether the straight motion between two configurations is proven to be free."""
        count = int(np.ceil(float(np.abs(end - start).max()) / TRIAL_STEP))
        shares = np.arange(1, count) / max(count, 1)
        for share in shares[np.argsort(np.abs(shares - 0.5))].tolist():
            if not self.is_free(start + share * (end - start)):
                return False
        return self.proves(StraightMotion(start, end))

    def first_unproven(self, motion: JointMotion) -> float | None:
        """Returns a time at which a motion is not proven to be free; None for a motion that is free."""
        self.proofs += 1
        pairs = len(self.first)
        times, which = np.array((0.0, motion.duration)), np.arange(pairs + len(self.margins))
        q = motion.at(times)
        known: dict[float, Array] = {}
        gaps = self._bounds(q, which)
        t0, t1 = (np.full(len(which), time) for time in times)
        g0, g1 = gaps
        exact0, exact1 = which >= pairs, which >= pairs
        while len(which):
            step = motion.variation(t0, t1)
            change = (step * self._all_reach[which]).sum(axis=1)
            waits = g0 + g1 <= change
            if not waits.any():
                return None
            t0, t1, g0, g1, which, change, step, exact0, exact1 = (
                each[waits] for each in (t0, t1, g0, g1, which, change, step, exact0, exact1)
            )
            if (bad := (g0 < 0.0) & exact0).any():
                return float(t0[bad].min())
            if (bad := (g1 < 0.0) & exact1).any():
                return float(t1[bad].min())
            measured = (exact0 & exact1) | (change > FAR_M)
            if not measured.all():  # exact distances where bounds did not suffice
                for at, gap, exact in ((t0, g0, exact0), (t1, g1, exact1)):
                    asked = ~exact & ~measured
                    for time in np.unique(at[asked]).tolist():
                        rows = np.flatnonzero((at == time) & asked)
                        gap[rows] = self._exact(known, motion, time, which[rows])
                        if (gap[rows] < 0.0).any():
                            return time
                    exact |= asked
                continue
            if (step.max(axis=1) < SMALLEST_STEP).any() or len(which) > MAX_ROWS:
                return float(t0[int(np.argmin(step.max(axis=1)))])
            middle = (t0 + t1) / 2.0
            unique, back = np.unique(middle, return_inverse=True)
            asked = np.unique(which)
            bounds = self._bounds(motion.at(unique), asked)[back, np.searchsorted(asked, which)]
            is_margin = which >= pairs
            t0, t1 = np.concatenate((t0, middle)), np.concatenate((middle, t1))
            g0, g1 = np.concatenate((g0, bounds)), np.concatenate((bounds, g1))
            exact0, exact1 = np.concatenate((exact0, is_margin)), np.concatenate((is_margin, exact1))
            which = np.concatenate((which, which))
        return None

    def _exact(self, known: dict[float, Array], motion: JointMotion, time: float, which: Array) -> Array:
        """Returns exact distances of pairs at one time of a motion, less the padding [m]."""
        if time not in known:
            known[time] = np.full(len(self.first), np.nan)
        gaps = known[time]
        missing = which[np.isnan(gaps[which])]
        if len(missing):
            gaps[missing] = self.distances(motion.at(np.array((time,)))[0], missing.tolist()) - self.padding[missing]
        values: Array = gaps[which]
        return values

    def _bounds(self, q: Array, which: Array) -> Array:
        """Returns lower bounds on the distances of pairs in k configurations, less the padding, k x len(which) [m].

        A bound is the distance from the ball around one shape to the box around the other. Margins are exact.
        """
        pairs = which[which < len(self.first)]
        a, b = self.first[pairs], self.second[pairs]
        places = self._places(q)
        rotation, centre = places[..., :3, :3], np.einsum("ksij,sj->ksi", places[..., :3, :3], self._middle)
        centre += places[..., :3, 3]
        bounds = np.full((len(q), len(pairs)), -np.inf)
        for ball, box in ((a, b), (b, a)):
            offset = centre[:, ball] - centre[:, box]
            local = np.einsum("kpji,kpj->kpi", rotation[:, box], offset)
            outside = np.maximum(np.abs(local) - self._half[box], 0.0)
            np.maximum(bounds, np.sqrt((outside * outside).sum(axis=2)) - self._radii[ball], out=bounds)
        bounds -= self.padding[pairs] + ROUNDING_M
        extra = [self.margins[i - len(self.first)].margins(q)[:, None] for i in which[len(pairs) :].tolist()]
        gaps: Array = np.concatenate([bounds, *extra], axis=1)
        return gaps


def _ball_and_box(hull: Hull) -> tuple[Array, Array, float]:
    """Returns middle and half lengths of a box around a shape, in the shape's frame, and the radius of a ball there.

    A half-space has a large box, and no ball.
    """
    solid = hull.solid
    if solid.normal is not None:
        return np.array((0.0, 0.0, -1e3)), np.full(3, 1e3), np.inf
    low, high = solid.extent
    middle = (low + high) / 2.0
    radius = (np.linalg.norm(solid.balls[:, :3] - middle, axis=1) + solid.balls[:, 3]).max()
    return middle, (high - low) / 2.0, float(radius)


def collision_model(scene: PlanningScene, group: Group, margins: Sequence[Margin] = ()) -> CollisionModel:
    """Returns the collision model of a scene and a group, which is kept until the scene changes.

    See `CollisionModel` for arguments and errors.
    """
    names = [robot.name for robot in group.robots]
    others = tuple((name, each.positions.tobytes()) for name, each in scene.robots.items() if name not in names)
    ignored = sum(len(each.never_checked) for each in scene.robots.values())
    key = scene.version, tuple(names), group.joint_names, scene.padding_m, scene.self_padding_m, others, ignored
    if scene.kept_model[0] != key:
        scene.kept_model = key, CollisionModel(scene, group)
    model = scene.kept_model[1]
    assert isinstance(model, CollisionModel)
    model.use(group, margins)
    model.update()
    return model


def _is_allowed(allowed: set[frozenset[str]], a: str, b: str) -> bool:
    if not allowed:
        return False
    return any(frozenset((x, y)) in allowed for x in {a, a.split("/")[0]} for y in {b, b.split("/")[0]})


def _hull_of(body: str, shape: Obstacle) -> Hull:
    try:
        return hull_of(shape)
    except ValueError as error:
        raise ConfigError([Problem(shape.mesh_file, f"body '{body}'", str(error))]) from None
