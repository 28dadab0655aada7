"""Base class of checks that measure distances between shapes, and choice of the library for these measurements."""

import math
from abc import abstractmethod
from importlib.util import find_spec

import numpy as np

from robot_model.collision.distances import Geometry, LinkDistances, Pair, Shapes
from robot_model.model import RobotModel
from safe_robot.check import Check, MarginViolation, Violation
from safe_robot.motion import Bound, CommandedMotion

from .proximity import Proximity

GEOMETRY = (
    "Form of meshes: `hulls` uses their convex hulls, which is fast. `exact` uses the meshes themselves where hulls are"
    " too near, and requires `./rpbi setup ik`."
)
"""Description of an option of type `Geometry`."""


def shapes_of(robot: RobotModel) -> Shapes:
    """Loads the collision shapes of a robot into PyBullet, or into hpp-fcl if PyBullet is not installed.

    Raises:
        ConfigError: If the robot cannot be loaded.
        MissingDependency: If neither library is installed.
    """
    if find_spec("pybullet"):
        from safe_robot.bullet import BulletShapes  # imports the simulator

        return BulletShapes(robot)
    from robot_model.collision.fcl import FclShapes  # of the extra `ik`

    return FclShapes(robot)


def link_distances(robot: RobotModel, geometry: Geometry = "hulls") -> LinkDistances:
    """Returns an object that measures distances of a robot's links from each other and from obstacles.

    Raises:
        ConfigError: If the robot cannot be loaded.
        MissingDependency: If a library is not installed.
    """
    return LinkDistances(robot, shapes_of(robot), geometry)


class ProximityCheck(Check):
    """Base class of checks that keep pairs of shapes further apart than the configured margin.

    Attributes:
        distances: Measures distances between shapes.
        proximity: Finds the pairs that come too near.
    """

    distances: LinkDistances
    proximity: Proximity

    def bounds(self, rows: np.ndarray, spread: np.ndarray, before: np.ndarray) -> list[Bound]:
        """See `Check`."""
        return self.proximity.bounds(rows, spread, before)

    def inside(self, q: np.ndarray) -> list[MarginViolation]:
        """See `Check`."""
        near = self.proximity.contacts(q, self.config.margin_m)
        return [
            MarginViolation(
                self.name,
                pair,
                self.subject(pair),
                contact.distance,
                self.config.margin_m,
                self.distances.gradient(pair, contact, q),
            )
            for pair, contact in near
        ]

    @abstractmethod
    def subject(self, pair: Pair) -> str:
        """Returns a description of a pair of shapes, for messages."""

    def undefined(self, motion: CommandedMotion) -> Violation | None:
        """Returns a violation if a motion has non-finite numbers, for which PyBullet finds no contact; else None."""
        if np.isfinite(motion.position).all():
            return None
        return Violation(self.name, "the robot", math.nan, self.config.margin_m, "m", quantity="distance")

    def too_near(self, motion: CommandedMotion) -> Violation | None:
        """Returns a violation if a pair comes too near in a motion; otherwise None."""
        found = self.proximity.first(motion)
        if found is None:
            return None
        subject, margin_m = self.subject(found.pair), self.config.margin_m
        return Violation(self.name, subject, found.distance, margin_m, "m", found.is_while_braking, "distance")
