"""Distances between the links of a robot, in a PyBullet client of its own."""

import math
import random
import weakref
from collections.abc import Sequence

import numpy as np
import pybullet

from rpbi.engine.client import Client
from rpbi.urdf.joints import Joint
from rpbi.urdf.loading import load_urdf

from .robot import GuardedRobot

Pair = tuple[str, str]
SAMPLES = 200
"""Random configurations in which pairs are tried that may always be near."""
ALWAYS = 0.95
"""Pairs that are too near in this share of them are left out: they are built so."""


class LinkDistances:
    """Distances between the collision shapes of links: convex hulls, where a shape is a mesh.

    Args:
        robot: The robot; its meshes have to be there.

    Attributes:
        links: Links that have a collision shape.
        radius_m: How far the shape of each goes from the link's origin, at most [m].

    Raises:
        ConfigError: If the robot cannot be loaded.
    """

    def __init__(self, robot: GuardedRobot) -> None:
        self._robot = robot
        self._pb = Client(pybullet.DIRECT)
        weakref.finalize(self, self._pb.disconnect)
        self._body = load_urdf(self._pb, robot.urdf_path, {"fileName": robot.urdf_path, "useFixedBase": True})
        joints = Joint.all_of(self._pb, self._body)
        self._moving = [(joint.index, joint.name) for joint in joints if robot.document.joints[joint.name].is_moving]
        names = {-1: self._pb.getBodyInfo(self._body)[0].decode(), **{joint.index: joint.link for joint in joints}}
        self._index = {name: i for i, name in names.items() if self._pb.getCollisionShapeData(self._body, i)}
        self.links = tuple(self._index)
        self.place(np.zeros(len(robot.joint_names)))
        self.radius_m = {link: self._radius(link) for link in self.links}

    def place(self, q: np.ndarray) -> None:
        """Puts the robot into a configuration of n positions [rad or m]."""
        positions = self._robot.positions_of_all(q)
        indices = [index for index, _ in self._moving]
        values = [[positions[name]] for _, name in self._moving]
        self._pb.resetJointStatesMultiDof(self._body, indices, values)

    def distance(self, pair: Pair, most_m: float) -> float:
        """Returns how far two links are apart where `place` put them [m]; inf if that is more than some distance."""
        a, b = (self._index[link] for link in pair)
        body = self._body
        points = self._pb.getClosestPoints(bodyA=body, bodyB=body, distance=most_m, linkIndexA=a, linkIndexB=b)
        return min((point[8] for point in points), default=math.inf)

    def reach(self, pair: Pair) -> np.ndarray:
        """Returns how far, at most, each of n joints moves two links in each other, for 1 rad or m each."""
        a, b = pair
        return self._robot.reach(a, self.radius_m[a], b) + self._robot.reach(b, self.radius_m[b], a)

    def pairs(self, margin_m: float) -> list[Pair]:
        """Returns the pairs of links that may come too near.

        Those that a joint ties, or several fixed ones, are left out, and those that nearly always are nearer than the
        margin [m], as in a compact wrist. It goes by random configurations, the same every time.
        """
        groups = {link: self._group(link) for link in self.links}
        parents = {child: self._group(parent) for child, parent in self._parents().items()}
        apart = [
            (a, b)
            for i, a in enumerate(self.links)
            for b in self.links[i + 1 :]
            if groups[a] != groups[b] and parents.get(groups[a]) != groups[b] and parents.get(groups[b]) != groups[a]
        ]
        touching = dict.fromkeys(apart, 0)
        generator = random.Random(0)
        for _ in range(SAMPLES):
            self.place(np.array([_anywhere(generator, joint.lower, joint.upper) for joint in self._robot.joints]))
            for pair in apart:
                touching[pair] += self.distance(pair, margin_m) < margin_m
        return [pair for pair in apart if touching[pair] < ALWAYS * SAMPLES]

    def _group(self, link: str) -> str:
        """Returns the first of the links that fixed joints tie to a link."""
        for joint in reversed(self._robot.chain(link)):
            if joint.is_moving:
                return joint.child
            link = joint.parent
        return link

    def _parents(self) -> dict[str, str]:
        """Returns the link above each that a joint moves."""
        return {joint.child: joint.parent for joint in self._robot.document.joints.values() if joint.is_moving}

    def _radius(self, link: str) -> float:
        """Returns how far the shape of a link goes from the link's origin, at most [m]."""
        lower, upper = self._pb.getAABB(self._body, self._index[link])
        pose = self._robot.poses(np.zeros((1, len(self._robot.joint_names))), [link])[link]
        return math.hypot(*np.maximum(np.subtract(upper, pose.position[0]), np.subtract(pose.position[0], lower)))


def _anywhere(generator: random.Random, lower: float, upper: float) -> float:
    return generator.uniform(max(lower, -math.pi), min(upper, math.pi))


def named(pair: Sequence[str]) -> str:
    """Returns a pair in words."""
    return f"links '{pair[0]}' and '{pair[1]}'"
