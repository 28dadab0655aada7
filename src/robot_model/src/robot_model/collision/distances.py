"""Distances between the links of a robot, and between links and obstacles."""

import math
from collections.abc import Sequence
from importlib import import_module
from typing import Any, Literal, NamedTuple, Protocol

import numpy as np

from custom_ros_tools.errors import ConfigError, Problem
from custom_ros_tools.transforms import matrix_of
from robot_model.geometry import Pose, Vector
from robot_model.model import RobotModel

from .shapes import Obstacle, collision_shapes
from .solids import ClosestPoints, Solid

Geometry = Literal["hulls", "exact"]
"""Meshes as their convex hulls; or, where hulls are near each other, as their triangles."""
Pair = tuple[str, str | int]
"""Two links, or a link and the number of an obstacle."""
SIGN_STEP = 1e-4
"""Step of the joints by which the sign of a gradient is tried [rad or m]."""
MIN_GRADIENT = 1e-6
"""Largest gradient of a distance that counts as none [m/rad]."""


class Shapes(Protocol):
    """Convex collision shapes of a robot and of obstacles, in a library that measures distances.

    `FclShapes` implements it with hpp-fcl. Obstacles have numbers.

    Attributes:
        links: Links that have a collision shape.
    """

    links: tuple[str, ...]

    def place(self, q: np.ndarray) -> None:
        """Moves the robot to a configuration of n positions [rad or m]."""

    def put(self, number: int, obstacle: Obstacle) -> None:
        """Adds an obstacle, and removes the previous one of its number.

        Raises:
            ValueError: If the library cannot represent it.
        """

    def move(self, number: int, pose: Pose) -> None:
        """Moves an obstacle to a pose in the robot's root link."""

    def remove(self, number: int) -> None:
        """Removes the obstacle of a number, if there is one."""

    def closest(self, link: str, other: str | int, most_m: float) -> list[ClosestPoints]:
        """Returns the closest points of each pair of shapes of a link and of another link or an obstacle.

        Pairs that are further apart than `most_m` [m] are left out.
        """

    def solids_of(self, link: str) -> list[Solid]:
        """Returns the shapes of a link in its frame, at least as large as the library measures them."""

    def solids_of_obstacle(self, number: int) -> list[Solid]:
        """Returns the shapes of an obstacle in its own frame, as `solids_of`."""

    def radius_m(self, link: str, origin: np.ndarray) -> float:
        """Returns the largest distance of the shapes of a link from a point in the root link [m]."""


class Contact(NamedTuple):
    """Distance between a link and another link or an obstacle.

    Attributes:
        distance: Distance between their surfaces; negative if they penetrate [m].
        direction: Unit vector from one to the other, in either sense, in the robot's root link.
        first: The closest point of the first, in the root link [m].
        second: The closest point of the second, in the root link [m].
        directions: `direction` for each pair of their shapes.
        is_exact: Whether exact shapes were measured: then `direction` points from the second to the first.
    """

    distance: float
    direction: Vector
    first: Vector
    second: Vector
    directions: tuple[Vector, ...]
    is_exact: bool = False


class LinkDistances:
    """Distances between the links of a robot, and between links and obstacles.

    Meshes are measured as their convex hulls. With exact geometry, meshes whose hulls are near each other are measured
    by their triangles.

    Args:
        robot: The robot; the files of its collision meshes must exist.
        shapes: Its shapes in a library that measures distances.
        geometry: Whether meshes near each other are measured exactly.

    Attributes:
        links: Links that have a collision shape.
        radius_m: Largest distance of the shapes of each link from its origin [m].

    Raises:
        ConfigError: If exact shapes cannot be read.
        MissingDependency: If exact shapes need a library that is not installed.
    """

    def __init__(self, robot: RobotModel, shapes: Shapes, geometry: Geometry = "hulls") -> None:
        self._robot, self._shapes = robot, shapes
        self._exact = None if geometry == "hulls" else import_module("robot_model.collision.exact")  # needs hpp-fcl
        self.links = shapes.links
        self._obstacles: tuple[Obstacle, ...] = ()
        self._pieces: dict[str | int, list[Any]] = {}
        self.place(np.zeros(len(robot.joint_names)))
        origins = {link: robot.frames.positions(self._placed[None], link)[0] for link in self.links}
        self.radius_m = {link: shapes.radius_m(link, origin) for link, origin in origins.items()}
        self._solids: dict[str | int, list[Solid]] = {link: self._solids_of(link) for link in self.links}

    def place(self, q: np.ndarray) -> None:
        """Moves the robot to a configuration of n positions [rad or m]."""
        self._placed = q
        self._shapes.place(q)

    def place_obstacles(self, obstacles: Sequence[Obstacle]) -> list[int]:
        """Replaces all obstacles; returns the numbers of those that are new or have moved.

        Raises:
            ValueError: If the library cannot represent one.
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

    def solids(self, member: str | int) -> list[Solid]:
        """Returns the shapes of a link in its frame, see `LinkFrames`, or those of an obstacle in the root link."""
        if isinstance(member, str):
            return self._solids[member]
        return [solid.moved(0, self._pose(member)) for solid in self._solids[member]]

    def pieces(self, member: str | int) -> list[Any]:
        """Returns the exact shapes of a link or an obstacle as `solids` does; none where hulls are used."""
        if isinstance(member, str):
            return self._pieces[member]
        return [piece.moved(0, self._pose(member)) for piece in self._pieces[member]]

    def _pose(self, obstacle: int) -> np.ndarray:
        return matrix_of(*self._obstacles[obstacle].pose)

    def frames(self, q: np.ndarray) -> np.ndarray:
        """Returns the frames of links in k configurations of n positions, see `LinkFrames.at`."""
        return self._robot.frames.at(q)

    def distance(self, pair: Pair, most_m: float, within_m: float = -math.inf) -> float:
        """Returns the distance of a pair in the present configuration [m]; inf beyond `most_m`, see `contact`."""
        contact = self.contact(pair, most_m, within_m)
        return math.inf if contact is None else contact.distance

    def contact(self, pair: Pair, most_m: float, within_m: float = -math.inf) -> Contact | None:
        """Returns the contact of a pair in the present configuration; None if it is too far apart.

        Args:
            pair: The pair.
            most_m: Largest distance that is measured [m].
            within_m: Required distance [m]. If hulls are nearer, exact shapes are measured, if there are any; if these
                are at least that far apart, the distance returned is `within_m`.
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
        """Returns the contact of the exact shapes of a pair.

        It is that of the hulls if there are no exact shapes, or they penetrate.
        """
        assert self._exact is not None
        pieces = [self.pieces(member) for member in pair]
        if not all(pieces):
            return contact
        found: ClosestPoints | None = self._exact.nearest(*pieces, self.frames(self._placed[None])[0], within_m)
        if found is None:
            return contact
        if not found.distance < within_m:
            return contact._replace(distance=within_m)
        return Contact(*found, directions=contact.directions, is_exact=True)

    def gradient(self, pair: Pair, contact: Contact, q: np.ndarray) -> np.ndarray:
        """Returns the derivative of the distance of a pair by each of n joints [m/rad or 1].

        Libraries do not say in which sense `direction` points. So the robot moves by a small step, and back.

        Args:
            pair: The pair.
            contact: Its contact in the present configuration.
            q: The present configuration, n positions.
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
        """Returns upper bounds of the change of a pair's distance by each of n joints, see `RobotModel.reach`."""
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
