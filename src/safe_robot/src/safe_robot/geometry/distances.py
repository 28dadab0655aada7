"""Distances between the links of a robot and obstacles, in a PyBullet client of its own."""

import math
import weakref
from collections.abc import Sequence
from importlib import import_module
from typing import Any, Literal, NamedTuple

import numpy as np
import pybullet

from custom_ros_tools.errors import ConfigError, Problem
from custom_ros_tools.transforms import matrix_of
from rpbi.engine.client import Client
from rpbi.geometry import Vector, cross, dot, minus, rotated, scaled
from rpbi.urdf.joints import Joint
from rpbi.urdf.loading import load_urdf
from safe_robot.robot import GuardedRobot

from .hulls import Solid, missing_m, solids_of
from .obstacles import Obstacle

Geometry = Literal["hulls", "exact"]
"""What shapes are taken for."""
GEOMETRY = (
    "What decides where convex hulls of meshes are too near: hulls, which is fast; or exact, the meshes themselves,"
    " which needs `./rpbi setup ik`."
)
Pair = tuple[str, str | int]
"""Two links, or a link and the number of an obstacle."""
TRIED = 1e-4
"""By so much joints are moved to see which way is apart [rad or m]."""
FLAT = 1e-6
"""What goes apart no faster than this does not move [m/rad]."""


class Contact(NamedTuple):
    """How far two things are apart.

    Attributes:
        distance: Between their surfaces; negative if they are in each other [m].
        direction: Unit vector from one to the other, in the robot's root.
        first: Where one of them is nearest, in the root [m].
        second: The same for the other.
        directions: The same as `direction` for each two of their shapes.
        is_exact: Whether exact shapes say so: then `direction` points from the second to the first.
    """

    distance: float
    direction: Vector
    first: Vector
    second: Vector
    directions: tuple[Vector, ...]
    is_exact: bool = False


class LinkDistances:
    """Distances between the collision shapes of links.

    They are those of convex hulls, where a shape is a mesh. With exact geometry the shapes themselves decide where
    hulls are near.

    Args:
        robot: The robot; its meshes have to be there.
        geometry: What shapes are taken for.

    Attributes:
        links: Links that have a collision shape.
        radius_m: How far the shape of each goes from the link's origin, at most [m].

    Raises:
        ConfigError: If the robot cannot be loaded.
        MissingDependency: If exact shapes need what is not installed.
    """

    def __init__(self, robot: GuardedRobot, geometry: Geometry = "hulls") -> None:
        self._robot = robot
        self._exact = None if geometry == "hulls" else import_module("safe_robot.geometry.exact")
        self._pb = Client(pybullet.DIRECT)
        weakref.finalize(self, self._pb.disconnect)
        self._body = load_urdf(self._pb, robot.urdf_path, {"fileName": robot.urdf_path, "useFixedBase": True})
        joints = Joint.all_of(self._pb, self._body)
        moving = [(joint.index, joint.name) for joint in joints if robot.document.joints[joint.name].is_moving]
        self._moving = [index for index, _ in moving]
        self._row = {name: i for i, (_, name) in enumerate(moving)}
        self._all = robot.coupling([name for _, name in moving])
        names = {-1: self._pb.getBodyInfo(self._body)[0].decode(), **{joint.index: joint.link for joint in joints}}
        self._index = {name: i for i, name in names.items() if self._pb.getCollisionShapeData(self._body, i)}
        self._obstacles: tuple[tuple[Obstacle, int], ...] = ()
        self.links = tuple(self._index)
        self._pieces: dict[str | int, list[Any]] = {}
        self.place(np.zeros(len(robot.joint_names)))
        self.radius_m = {link: self._radius(link) for link in self.links}
        self._solids: dict[str | int, list[Solid]] = {link: self._solids_of(link) for link in self.links}
        self._missing_m: dict[str | int, float] = {
            link: missing_m(self._pb, self._body, self._index[link]) for link in self.links
        }

    def place(self, q: np.ndarray) -> None:
        """Puts the robot into a configuration of n positions [rad or m]."""
        self._placed = q
        factors, offsets = self._all
        values = (factors @ q + offsets)[:, None].tolist()
        self._pb.resetJointStatesMultiDof(self._body, self._moving, values)

    def place_obstacles(self, obstacles: Sequence[Obstacle]) -> list[int]:
        """Puts obstacles where they are, in place of those before; returns which of them are new or elsewhere.

        Raises:
            ValueError: If PyBullet cannot have one.
        """
        before, now, changed = self._obstacles, list[tuple[Obstacle, int]](), list[int]()
        self._obstacles = ()
        for i, obstacle in enumerate(obstacles):
            old, body = before[i] if i < len(before) else (None, -1)
            if old is None or old.shape != obstacle.shape:
                if body >= 0:
                    self._pb.removeBody(body)
                body = obstacle.add_to(self._pb)
                self._solids[i] = solids_of(self._pb, body, -1)
                self._missing_m[i] = missing_m(self._pb, body, -1)
                if self._exact is not None:
                    self._pieces[i] = self._exact.pieces_of_obstacle(obstacle, self._solids[i])
                changed.append(i)
            elif old.pose != obstacle.pose:
                self._pb.resetBasePositionAndOrientation(body, *obstacle.pose)
                changed.append(i)
            now.append((obstacle, body))
        for _, body in before[len(now) :]:
            self._pb.removeBody(body)
        self._obstacles = tuple(now)
        return changed

    def solids(self, thing: str | int) -> list[Solid]:
        """Returns the shapes of a link, or of an obstacle where it was put."""
        if isinstance(thing, str):
            return self._solids[thing]
        return [solid.moved(0, self._pose(thing)) for solid in self._solids[thing]]

    def pieces(self, thing: str | int) -> list[Any]:
        """Returns the exact shapes of a link, or of an obstacle where it was put; none if there are none."""
        if isinstance(thing, str):
            return self._pieces[thing]
        return [piece.moved(0, self._pose(thing)) for piece in self._pieces[thing]]

    def _pose(self, obstacle: int) -> np.ndarray:
        return matrix_of(*self._obstacles[obstacle][0].pose)

    def frames(self, q: np.ndarray) -> np.ndarray:
        """Returns where links are, in k configurations of n positions, see `LinkFrames`."""
        return self._robot.frames.at(q)

    def distance(self, pair: Pair, most_m: float, within_m: float = -math.inf) -> float:
        """Returns how far two things are apart where they were put [m]; inf beyond `most_m`, see `contact`."""
        contact = self.contact(pair, most_m, within_m)
        return math.inf if contact is None else contact.distance

    def contact(self, pair: Pair, most_m: float, within_m: float = -math.inf) -> Contact | None:
        """Returns where two things are nearest where they were put; None if they are further apart than a distance.

        Args:
            pair: The two.
            most_m: The distance [m].
            within_m: How far apart they have to be [m]. If hulls are nearer, exact shapes are asked, where there are
                any; if these are further apart, the distance is this.
        """
        missing_m = self._missing_m[pair[0]] + self._missing_m[pair[1]]
        points = self._closest(pair, most_m + missing_m)
        if not points:
            return None
        point = min(points, key=lambda each: each[8])
        contact = Contact(point[8] - missing_m, point[7], point[5], point[6], tuple(each[7] for each in points))
        if self._exact is None or contact.distance >= within_m:
            return contact
        return self._exactly(pair, contact, within_m)

    def _exactly(self, pair: Pair, contact: Contact, within_m: float) -> Contact:
        """Returns a contact of hulls as exact shapes have it; the same if they are in each other, or there are none."""
        assert self._exact is not None
        pieces = [self.pieces(thing) for thing in pair]
        if not all(pieces):
            return contact
        found = self._exact.nearest(*pieces, self.frames(self._placed[None])[0], within_m)
        if found is None:
            return contact
        if not found.distance < within_m:
            return contact._replace(distance=within_m)
        direction = scaled(1.0 / found.distance, minus(found.first, found.second))
        return Contact(found.distance, direction, found.first, found.second, contact.directions, True)

    def gradient(self, pair: Pair, contact: Contact, q: np.ndarray) -> np.ndarray:
        """Returns how fast two things go apart as each of n joints moves, by where `contact` found them [m/rad or 1].

        The robot is in q, n positions, and put there again: which of two links PyBullet took first has to be tried.
        """
        states = self._pb.getLinkStates(self._body, self._moving, computeForwardKinematics=1)
        along = np.zeros(len(self._moving))
        for link, point, sign in ((pair[0], contact.first, 1.0), (pair[1], contact.second, -1.0)):
            for joint in self._robot.chain(link) if isinstance(link, str) else ():
                if joint.is_moving:
                    i = self._row[joint.name]
                    axis = rotated(states[i][5], joint.axis)
                    way = cross(axis, minus(point, states[i][4])) if joint.is_revolute else axis
                    along[i] += sign * dot(contact.direction, way)
        gradient = along @ self._all[0]
        steepest = float(np.abs(gradient).max())
        if steepest < FLAT or contact.is_exact:
            return gradient
        self.place(q + TRIED * gradient / steepest)
        is_further = self.distance(pair, math.inf) > contact.distance
        self.place(q)
        return gradient if is_further else -gradient

    def _closest(self, pair: Pair, most_m: float) -> Any:
        link, other = pair
        a, body = self._index[link], self._body
        second = (body, self._index[other]) if isinstance(other, str) else (self._obstacles[other][1], -1)
        return self._pb.getClosestPoints(body, second[0], most_m, a, second[1])

    def reach(self, pair: Pair) -> np.ndarray:
        """Returns how far, at most, each of n joints moves two things in each other, for 1 rad or m each."""
        a, b = pair
        if isinstance(b, int):
            return self._robot.reach(a, self.radius_m[a])
        return self._robot.reach(a, self.radius_m[a], b) + self._robot.reach(b, self.radius_m[b], a)

    def _solids_of(self, link: str) -> list[Solid]:
        frame, pose = self._robot.frames.place(link)
        index = self._index[link]
        mass = pose @ matrix_of(*self._pb.getDynamicsInfo(self._body, index)[3:5])
        solids = solids_of(self._pb, self._body, index)
        if self._exact is not None:
            try:
                pieces = self._exact.pieces_of_link(self._pb, self._body, index, solids)
            except ValueError as error:
                raise ConfigError([Problem(self._robot.urdf_path, f"link '{link}'", str(error))]) from None
            self._pieces[link] = [piece.moved(frame, mass) for piece in pieces]
        return [solid.moved(frame, mass) for solid in solids]

    def _radius(self, link: str) -> float:
        """Returns how far the shape of a link goes from the link's origin, at most [m]."""
        lower, upper = self._pb.getAABB(self._body, self._index[link])
        origin = self._robot.link_positions(np.zeros((1, len(self._robot.joint_names))), link)[0]
        return math.hypot(*np.maximum(np.subtract(upper, origin), np.subtract(origin, lower)))
