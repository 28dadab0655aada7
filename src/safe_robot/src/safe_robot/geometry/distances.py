"""Distances between the links of a robot and obstacles."""

import math
from collections.abc import Sequence
from importlib import import_module
from importlib.util import find_spec
from typing import Any, Literal, NamedTuple, Protocol

import numpy as np

from custom_ros_tools.errors import ConfigError, Problem
from custom_ros_tools.transforms import matrix_of
from robot_model.geometry import Pose, Vector
from robot_model.urdf.shapes import collision_shapes
from safe_robot.robot import GuardedRobot

from .obstacles import Obstacle
from .solids import ClosestPoints, Solid

Geometry = Literal["hulls", "exact"]
"""The form in which shapes are measured."""
GEOMETRY = (
    "What decides where convex hulls of meshes are too near: hulls, which is fast; or exact, the meshes themselves,"
    " which needs `./rpbi setup ik`."
)
Pair = tuple[str, str | int]
"""Two links, or a link and the number of an obstacle."""
SIGN_STEP = 1e-4
"""Step of the joints by which the sign of a gradient is tried [rad or m]."""
MIN_GRADIENT = 1e-6
"""Largest gradient of a distance that counts as none [m/rad]."""


class Shapes(Protocol):
    """Convex collision shapes of a robot and of obstacles in a library that measures distances, see `BulletShapes`."""

    links: tuple[str, ...]

    def place(self, q: np.ndarray) -> None: ...

    def put(self, number: int, obstacle: Obstacle) -> None: ...

    def move(self, number: int, pose: Pose) -> None: ...

    def remove(self, number: int) -> None: ...

    def closest(self, link: str, other: str | int, most_m: float) -> list[ClosestPoints]: ...

    def solids_of(self, link: str) -> list[Solid]: ...

    def solids_of_obstacle(self, number: int) -> list[Solid]: ...

    def radius_m(self, link: str, origin: np.ndarray) -> float: ...


def shapes_of(robot: GuardedRobot) -> Shapes:
    """Returns the shapes of a robot in PyBullet, or in hpp-fcl where PyBullet is not installed.

    Raises:
        ConfigError: If the robot cannot be loaded.
        MissingDependency: If neither library is installed.
    """
    if find_spec("pybullet"):
        from .bullet import BulletShapes  # loads the simulator

        return BulletShapes(robot)
    from .fcl import FclShapes  # of the extra `ik`

    return FclShapes(robot)


class Contact(NamedTuple):
    """Distance between two things.

    Attributes:
        distance: Between their surfaces; negative if they penetrate [m].
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
        self._shapes = shapes_of(robot)
        self.links = self._shapes.links
        self._obstacles: tuple[Obstacle, ...] = ()
        self._pieces: dict[str | int, list[Any]] = {}
        self.place(np.zeros(len(robot.joint_names)))
        origins = {link: robot.frames.positions(self._placed[None], link)[0] for link in self.links}
        self.radius_m = {link: self._shapes.radius_m(link, origin) for link, origin in origins.items()}
        self._solids: dict[str | int, list[Solid]] = {link: self._solids_of(link) for link in self.links}

    def place(self, q: np.ndarray) -> None:
        """Puts the robot into a configuration of n positions [rad or m]."""
        self._placed = q
        self._shapes.place(q)

    def place_obstacles(self, obstacles: Sequence[Obstacle]) -> list[int]:
        """Puts obstacles where they are, in place of those before; returns which of them are new or elsewhere.

        Raises:
            ValueError: If the library cannot have one.
        """
        before, changed = self._obstacles, list[int]()
        self._obstacles = ()
        for i, obstacle in enumerate(obstacles):
            old = before[i] if i < len(before) else None
            if old is None or old.shape != obstacle.shape:
                self._shapes.put(i, obstacle)
                self._solids[i] = self._shapes.solids_of_obstacle(i)
                if self._exact is not None:
                    self._pieces[i] = self._exact.pieces_of_obstacle(obstacle, self._solids[i])
                changed.append(i)
            elif old.pose != obstacle.pose:
                self._shapes.move(i, obstacle.pose)
                changed.append(i)
        for i in range(len(obstacles), len(before)):
            self._shapes.remove(i)
        self._obstacles = tuple(obstacles)
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
        return matrix_of(*self._obstacles[obstacle].pose)

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
        points = self._shapes.closest(*pair, most_m)
        if not points:
            return None
        nearest = min(points, key=lambda each: each.distance)
        contact = Contact(*nearest, directions=tuple(each.direction for each in points))
        if self._exact is None or contact.distance >= within_m:
            return contact
        return self._exactly(pair, contact, within_m)

    def _exactly(self, pair: Pair, contact: Contact, within_m: float) -> Contact:
        """Returns a contact of hulls as exact shapes have it; the same if they are in each other, or there are none."""
        assert self._exact is not None
        pieces = [self.pieces(thing) for thing in pair]
        if not all(pieces):
            return contact
        found: ClosestPoints | None = self._exact.nearest(*pieces, self.frames(self._placed[None])[0], within_m)
        if found is None:
            return contact
        if not found.distance < within_m:
            return contact._replace(distance=within_m)
        return Contact(*found, directions=contact.directions, is_exact=True)

    def gradient(self, pair: Pair, contact: Contact, q: np.ndarray) -> np.ndarray:
        """Returns how fast two things go apart as each of n joints moves, by where `contact` found them [m/rad or 1].

        The robot is in q, n positions, and put there again: which of two links the library took first has to be tried.
        """
        gradient = np.zeros(len(q))
        for link, point, sign in ((pair[0], contact.first, 1.0), (pair[1], contact.second, -1.0)):
            if isinstance(link, str):
                gradient += sign * self._robot.frames.jacobian_at(q[None], link, point)[0, :3].T @ contact.direction
        steepest = float(np.abs(gradient).max())
        if steepest < MIN_GRADIENT or contact.is_exact:
            return gradient
        self.place(q + SIGN_STEP * gradient / steepest)
        is_further = self.distance(pair, math.inf) > contact.distance
        self.place(q)
        return gradient if is_further else -gradient

    def reach(self, pair: Pair) -> np.ndarray:
        """Returns how far, at most, each of n joints moves two things in each other, for 1 rad or m each."""
        a, b = pair
        if isinstance(b, int):
            return self._robot.reach(a, self.radius_m[a])
        return self._robot.reach(a, self.radius_m[a], b) + self._robot.reach(b, self.radius_m[b], a)

    def _solids_of(self, link: str) -> list[Solid]:
        frame, pose = self._robot.frames.place(link)
        solids = self._shapes.solids_of(link)
        if self._exact is not None:
            try:
                pieces = self._exact.pieces_of_link(collision_shapes(self._robot.document, link), solids)
            except (ValueError, OSError) as error:
                raise ConfigError([Problem(self._robot.urdf_path, f"link '{link}'", str(error))]) from None
            self._pieces[link] = [piece.moved(frame, pose) for piece in pieces]
        return [solid.moved(frame, pose) for solid in solids]
