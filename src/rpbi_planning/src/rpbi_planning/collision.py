"""Collision checks of configurations and motions by pinocchio and hpp-fcl."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np

from custom_ros_tools.errors import MissingDependency
from custom_ros_tools.transforms import matrix_of

try:
    import pinocchio as pin
except ImportError:
    raise MissingDependency("pinocchio", "./rpbi setup planning") from None

from robot_model.collision.fcl import Hull

from .group import Array, Group
from .proofs import JointMotion, StraightMotion, first_unproven
from .scene import PlanningScene
from .scene_pairs import ScenePairs

ROUNDING_M = 1e-6
"""Error of computed distances [m]."""
TRIAL_STEP = 0.25
"""Motion of a joint [rad or m] between two configurations that are checked before a motion is proven, since most
motions that are not free are found so."""


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


class CollisionModel(ScenePairs):
    """Checks configurations of a group of joints in a scene, and proves motions.

    Args:
        scene: The scene; later changes of poses are taken by `update`.
        group: The joints that move.
        margins: Further conditions.

    Attributes:
        all_reach: The reach of each pair, and then that of each margin, see `ScenePairs.reach`.

    Raises:
        ConfigError: If a mesh cannot be read.
        ValueError: If a shape of a body is invalid.
    """

    def __init__(self, scene: PlanningScene, group: Group, margins: Sequence[Margin] = ()) -> None:
        super().__init__(scene, group)
        self._own_padding = self.padding
        self.use(group, margins)
        self._data, self._placed = self.model.createData(), pin.GeometryData(self.geometry)
        self.checks = 0
        self.proofs = 0
        self.update()

    def use(self, group: Group, margins: Sequence[Margin]) -> None:
        """Replaces the margins, and the group by another one with the same joints."""
        self.group, self.margins = group, list(margins)
        self.all_reach = np.concatenate([self.reach, *(each.reach[None] for each in self.margins)])

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
        joints: Array = np.concatenate([to(self.group.full(q[None], r)[0]) for r, to in enumerate(self.joint_maps)])
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
        return first_unproven(self, motion)

    def bounds(self, q: Array, which: Array) -> Array:
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
