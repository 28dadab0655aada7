"""Distances to bodies of the environment."""

import math
from typing import Any

import numpy as np
from pydantic import Field

from custom_ros_tools.errors import ConfigError, Problem
from custom_ros_tools.schema import NonNegativeMetres, Text
from safe_robot.check import Check, CheckConfig, Inside, Situation, Violation
from safe_robot.commands.detour import Bound
from safe_robot.geometry.distances import GEOMETRY, Geometry, LinkDistances, Pair
from safe_robot.geometry.obstacles import Obstacle, obstacles_of_world
from safe_robot.geometry.proximity import Proximity
from safe_robot.limits import JointLimits
from safe_robot.motion import Motion
from safe_robot.robot import GuardedRobot


class EnvironmentConfig(CheckConfig):
    """How near links may come to bodies of the environment."""

    margin_m: NonNegativeMetres = Field(0.02, description="Least distance between links and bodies [m].")
    geometry: Geometry = Field("hulls", description=GEOMETRY)
    world: Text | None = Field(
        None, description="Main YAML file of a world: its bodies as they are at the start; without it, live ones."
    )
    robot: Text | None = Field(
        None, description="Name of the guarded robot in that world; by default its only body with these joints."
    )


class Environment(Check):
    """Links keep away from bodies of the environment, also while the robot brakes.

    Bodies are those of a world file and, where somebody tells of them, live ones. A body that comes nearer than the
    margin by itself leaves the robot only ways that do not bring it nearer still.
    """

    Config = EnvironmentConfig
    name = "environment"
    takes_obstacles = True

    def __init__(self, config: Any, robot: GuardedRobot, limits: JointLimits, file: str) -> None:
        super().__init__(config, robot, limits, file)
        self.distances = LinkDistances(robot, config.geometry)
        joints = {name for name, joint in robot.document.joints.items() if joint.is_moving}
        self._still = () if config.world is None else obstacles_of_world(config.world, joints, config.robot)
        self._links = [link for link in self.distances.links if self.distances.reach((link, 0)).any()]
        self._live: tuple[Obstacle, ...] | None = None
        self._obstacles: tuple[Obstacle, ...] = ()
        try:
            self._take(())
        except ValueError as error:
            raise ConfigError([Problem(config.world, "", str(error))]) from None

    def check(self, motion: Motion, situation: Situation) -> Violation | None:
        """See `Check`.

        Raises:
            ValueError: If an obstacle has no shape.
        """
        margin_m = self.config.margin_m
        if not np.isfinite(motion.position).all():  # PyBullet would find nothing near it
            return Violation(self.name, "the robot", math.nan, margin_m, "m", quantity="distance")
        if situation.obstacles is None and self.config.world is None:
            return Violation(self.name, "nobody tells what is around the robot", math.nan, math.nan, "")
        live = situation.obstacles or ()
        if live is not self._live:
            self._take(live)
        found = self.proximity.first(motion)
        if found is None:
            return None
        subject = self._subject(found.pair)
        return Violation(self.name, subject, found.distance, margin_m, "m", found.is_while_braking, "distance")

    def bounds(self, rows: np.ndarray, spread: np.ndarray, before: np.ndarray) -> list[Bound]:
        """See `Check`."""
        return self.proximity.bounds(rows, spread, before)

    def inside(self, q: np.ndarray) -> list[Inside]:
        """See `Check`."""
        return self.proximity.inside(q, self.name, self._subject)

    def _subject(self, pair: Pair) -> str:
        return f"link '{pair[0]}' and '{self._obstacles[int(pair[1])].name}'"

    def _take(self, live: tuple[Obstacle, ...]) -> None:
        """Puts obstacles where they are; what has not moved is not looked at anew."""
        self._live = None  # until all are there
        count = len(self._obstacles)
        obstacles = (*self._still, *live)
        for obstacle in live:
            if not np.isfinite((*obstacle.size, *obstacle.pose.position, *obstacle.pose.quat_xyzw)).all():
                raise ValueError(f"obstacle '{obstacle.name}': expected finite numbers, got {obstacle}")
        changed = set(self.distances.place_obstacles(obstacles))
        self._obstacles = obstacles
        if len(obstacles) != count or not hasattr(self, "proximity"):
            self._pairs = [(link, i) for i in range(len(obstacles)) for link in self._links]
            self.proximity = Proximity(self.distances, self._pairs, self.config.margin_m)
        else:
            self.proximity.forget([i for i, (_, number) in enumerate(self._pairs) if number in changed])
        self._live = live
