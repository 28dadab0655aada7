"""An oracle that shares nothing with the guard: differences of commands, exact shapes by Pinocchio and hpp-fcl."""

from __future__ import annotations

import math
from collections.abc import Sequence
from xml.etree import ElementTree

import numpy as np
import pinocchio

from .scenes import LIMITS, PERIOD_S, Scene

ROUNDING = 1e-6
"""Relative tolerance of differences."""
WATCHED_M = 0.022
"""Distance below which pairs are measured at a command [m]."""
FAR_M = 0.05
"""Upper limit of measured distances [m]."""


class Oracle:
    """Judges commands independently of the guard, with the triangles of the mesh files.

    Pairs are all links that no joint ties, and all moving links with each box.

    Args:
        scene: The robot and its surroundings.

    Attributes:
        lower: The least n positions, by the robot's description [rad].
        upper: The greatest.
        nearest_m: The smallest distance below `WATCHED_M` so far [m].
        worst: Largest share of each limit so far.
        faults: What was not safe.
    """

    def __init__(self, scene: Scene) -> None:
        xml = _with_boxes(scene)
        self._model = pinocchio.buildModelFromXML(xml)
        self._shapes = pinocchio.buildGeomFromUrdfString(
            self._model, xml, pinocchio.GeometryType.COLLISION, package_dirs=[str(scene.urdf.parent)]
        )
        self._add_pairs({f"{name}_0" for name in scene.boxes})
        self._data, self._found = self._model.createData(), self._shapes.createData()
        for request in self._found.collisionRequests:
            request.security_margin = WATCHED_M
        self.lower, self.upper = self._model.lowerPositionLimit, self._model.upperPositionLimit
        self.nearest_m = math.inf
        self.worst = dict.fromkeys(LIMITS, 0.0)
        self.faults: list[str] = []

    def _add_pairs(self, boxes: set[str]) -> None:
        shapes, parents = self._shapes.geometryObjects, self._model.parents
        for j, second in enumerate(shapes):
            for i, first in enumerate(shapes[:j]):
                a, b = first.parentJoint, second.parentJoint
                is_tied = a == b or (parents[a] == b or parents[b] == a) and not {first.name, second.name} & boxes
                if not is_tied:
                    self._shapes.addCollisionPair(pinocchio.CollisionPair(i, j))

    def place(self, q: Sequence[float]) -> None:
        """Judges the configuration of a command."""
        q = np.asarray(q)
        if not ((q >= self.lower - 1e-12) & (q <= self.upper + 1e-12)).all():
            self.faults.append(f"outside the limits of position: {q}")
        self._place(q)
        if not pinocchio.computeCollisions(self._shapes, self._found, False):
            return
        near = [i for i, result in enumerate(self._found.collisionResults) if result.isCollision()]
        nearest = min(self._distance(i) for i in near)
        if not nearest > 0.0:
            self.faults.append(f"in collision: {q}, {nearest:.3g} m")
        self.nearest_m = min(self.nearest_m, nearest)

    def distances(self, q: Sequence[float]) -> np.ndarray:
        """Returns the distance of each pair, at most `FAR_M` [m]."""
        self._place(np.asarray(q))
        return np.minimum([self._distance(i) for i in range(len(self._shapes.collisionPairs))], FAR_M)

    def _place(self, q: np.ndarray) -> None:
        pinocchio.updateGeometryPlacements(self._model, self._data, self._shapes, self._found, q)

    def _distance(self, pair: int) -> float:
        return float(pinocchio.computeDistance(self._shapes, self._found, pair).min_distance)

    def moves(self, commands: Sequence[Sequence[float]], from_rest: bool = True) -> None:
        """Judges the differences of successive commands, whether or not the robot is at rest before the first."""
        rows = np.array([commands[0]] * 3 * from_rest + list(commands))
        if len(rows) < 4:
            return
        for order, key in enumerate(LIMITS, start=1):
            share = float(np.abs(np.diff(rows, order, axis=0)).max()) / PERIOD_S**order / LIMITS[key]
            self.worst[key] = max(self.worst[key], share)
            if not share <= 1.0 + ROUNDING:
                self.faults.append(f"{key}: {share:.6f} of the limit")


def _with_boxes(scene: Scene) -> str:
    """Returns the description of the robot, with the boxes as links fixed to its root."""
    robot = ElementTree.parse(scene.urdf).getroot()
    children = {child.get("link") for child in robot.findall("joint/child")}
    root = next(link.attrib["name"] for link in robot.findall("link") if link.get("name") not in children)
    for name, (size, place) in scene.boxes.items():
        collision = ElementTree.SubElement(ElementTree.SubElement(robot, "link", name=name), "collision")
        ElementTree.SubElement(collision, "origin", xyz=" ".join(map(str, place)))
        ElementTree.SubElement(ElementTree.SubElement(collision, "geometry"), "box", size=" ".join(map(str, size)))
        joint = ElementTree.SubElement(robot, "joint", name=f"{name}_joint", type="fixed")
        ElementTree.SubElement(joint, "parent", link=root)
        ElementTree.SubElement(joint, "child", link=name)
    return ElementTree.tostring(robot, encoding="unicode")
