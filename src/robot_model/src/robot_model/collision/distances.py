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
"""Representation of meshes: always as convex hulls, or as triangles where two hulls are near each other."""
Pair = tuple[str, str | int]
"""Two links, or a link and the number of an obstacle."""
SIGN_STEP = 1e-4
"""Largest joint motion in the small step that determines the sign of a gradient [rad or m]."""
MIN_GRADIENT = 1e-6
"""A gradient of a distance below this threshold counts as zero [m/rad]."""


class Shapes(Protocol):
    """Convex collision shapes of a robot and of obstacles, held by a library that measures distances.

    `FclShapes` implements this protocol with hpp-fcl. Each obstacle is identified by a number.

    Attributes:
        links: Names of the links that have a collision shape.
    """

    links: tuple[str, ...]

    def place(self, q: np.ndarray) -> None:
        """Moves the robot to a configuration of n positions [rad or m]."""

    def put(self, number: int, obstacle: Obstacle) -> None:
        """Adds an obstacle, and removes the previous obstacle with the same number.

        Raises:
            ValueError: If the library cannot represent the obstacle.
        """

    def move(self, number: int, pose: Pose) -> None:
        """Moves an obstacle to a pose, given in the frame of the robot's root link."""

    def remove(self, number: int) -> None:
        """Removes the obstacle with this number, if it exists."""

    def closest(self, link: str, other: str | int, most_m: float) -> list[ClosestPoints]:
        """Finds the closest points between each shape of a link and each shape of another link or of an obstacle.

        Args:
            link: Name of the link.
            other: Name of the other link, or number of the obstacle.
            most_m: Largest distance [m]; pairs of shapes that are further apart are left out.
        """

    def solids_of(self, link: str) -> list[Solid]:
        """Returns solids that contain the shapes of a link, in the link's frame."""

    def solids_of_obstacle(self, number: int) -> list[Solid]:
        """Returns solids that contain the shapes of an obstacle, in the obstacle's own frame."""

    def radius_m(self, link: str, origin: np.ndarray) -> float:
        """Returns the distance from a point to the farthest point of a link's shapes [m].

        Args:
            link: Name of the link, which is measured in the current configuration.
            origin: The point x, y, z in the robot's root frame [m].
        """


class Contact(NamedTuple):
    """Distance between a link (the first body) and another link or an obstacle (the second body).

    All vectors are in the frame of the robot's root link.

    Attributes:
        distance: Distance between the surfaces; negative if the bodies penetrate each other [m].
        direction: Unit vector along the line between the closest points. Its sign is arbitrary unless `is_exact`.
        first: The closest point on the first body [m].
        second: The closest point on the second body [m].
        directions: For each pair of shapes of the two bodies, a unit vector along the line between the closest points.
        is_exact: Whether the distance is that of the exact shapes, not of the hulls. If so, `direction` points from the
            second body to the first.
    """

    distance: float
    direction: Vector
    first: Vector
    second: Vector
    directions: tuple[Vector, ...]
    is_exact: bool = False


class LinkDistances:
    """Measures distances between the links of a robot, and between links and obstacles.

    Meshes are measured as convex hulls. With `geometry="exact"`, meshes are measured as triangles where their hulls are
    near each other.

    Args:
        robot: The robot; the files of its collision meshes must exist.
        shapes: The robot's shapes in a library that measures distances.
        geometry: `hulls`, or `exact` to measure triangles where hulls are near each other.

    Attributes:
        links: Names of the links that have a collision shape.
        radius_m: Distance from each link's origin to the farthest point of the link's shapes, indexed by link name [m].

    Raises:
        ConfigError: If exact shapes cannot be read.
        MissingDependency: If `geometry` is `exact` and hpp-fcl is not installed.
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
        """Replaces all obstacles, and returns the numbers of the obstacles that are new or have moved.

        Raises:
            ValueError: If the library cannot represent an obstacle.
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
        """Returns solids that contain the shapes of a link or an obstacle.

        The solids of a link are in the frame that `LinkFrames` gives the link, those of an obstacle in the root frame.

        Args:
            member: Name of the link, or number of the obstacle.
        """
        if isinstance(member, str):
            return self._solids[member]
        return [solid.moved(0, self._pose(member)) for solid in self._solids[member]]

    def pieces(self, member: str | int) -> list[Any]:
        """Returns the exact shapes of a link or an obstacle, in the same frames as `solids`.

        The list is empty for planes and point sets, which are always measured as hulls. Requires `geometry="exact"`.
        """
        if isinstance(member, str):
            return self._pieces[member]
        return [piece.moved(0, self._pose(member)) for piece in self._pieces[member]]

    def _pose(self, obstacle: int) -> np.ndarray:
        return matrix_of(*self._obstacles[obstacle].pose)

    def frames(self, q: np.ndarray) -> np.ndarray:
        """Returns the frames of the links in k configurations, given as k x n positions; see `LinkFrames.at`."""
        return self._robot.frames.at(q)

    def distance(self, pair: Pair, most_m: float, within_m: float = -math.inf) -> float:
        """Returns the distance between the members of a pair in the current configuration [m]; inf beyond `most_m`.

        See `contact` for the arguments.
        """
        contact = self.contact(pair, most_m, within_m)
        return math.inf if contact is None else contact.distance

    def contact(self, pair: Pair, most_m: float, within_m: float = -math.inf) -> Contact | None:
        """Measures the distance between the members of a pair in the current configuration.

        Args:
            pair: Two links, or a link and the number of an obstacle.
            most_m: Largest distance that is measured [m].
            within_m: Distance of the hulls [m] below which exact geometry is used, if enabled. If the exact shapes are
                further apart than `within_m`, the returned distance is `within_m`.

        Returns:
            The contact; None if the distance exceeds `most_m`.
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
        """Returns the contact between the exact shapes of a pair, instead of `contact`, which is that of the hulls.

        Returns `contact` itself if exact shapes are missing or intersect, and `contact` with the distance `within_m` if
        the exact shapes are further apart than `within_m`.
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
        """Returns the derivatives of a pair's distance with respect to the n joint positions, shape (n,) [m/rad or 1].

        The sign of `contact.direction` is arbitrary unless exact shapes were measured. To find the sign, the modelled
        robot is moved by a small step and back.

        Args:
            pair: Two links, or a link and the number of an obstacle.
            contact: The pair's contact in the current configuration.
            q: The current configuration, n positions [rad or m].
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
        """Returns n upper bounds on the change of a pair's distance per rad or m of each joint.

        See `RobotModel.reach`.
        """
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
