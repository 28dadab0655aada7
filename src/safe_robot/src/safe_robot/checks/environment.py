"""Check of the distances between links and bodies of the environment."""

import math
from typing import Any

import numpy as np
from pydantic import Field

from custom_ros_tools.errors import ConfigError, Problem
from custom_ros_tools.schema import NonNegativeMetres, Seconds, Text
from robot_model.collision.distances import Geometry, Pair
from robot_model.collision.shapes import Obstacle
from robot_model.model import RobotModel
from safe_robot.check import CheckConfig, CheckContext, Violation
from safe_robot.limits import MotionLimits
from safe_robot.motion import CommandedMotion

from .proximity import Proximity
from .proximity_check import GEOMETRY, ProximityCheck, link_distances


class EnvironmentConfig(CheckConfig):
    """Minimum distance between the robot's links and bodies of the environment."""

    margin_m: NonNegativeMetres = Field(0.02, description="Least distance between links and bodies [m].")
    timeout_s: Seconds = Field(
        0.5,
        description="Largest age of the pose of a live obstacle, such as one from rpbi/markers. While a pose is "
        "older, no target is safe.",
    )
    geometry: Geometry = Field("hulls", description=GEOMETRY)
    world: Text | None = Field(
        None,
        description="Main YAML file of a world, whose bodies are obstacles at their start poses. By default, only "
        "live obstacles are used.",
    )
    robot: Text | None = Field(
        None,
        description="Name of the guarded robot in `world`. By default, the only body in `world` that has the guarded "
        "joints.",
    )


class Environment(ProximityCheck):
    """Checks that links keep their distance from bodies of the environment, also while the robot brakes.

    Bodies come from a world file, from `CheckContext.obstacles`, or from both. If a moving body comes nearer than the
    margin, the robot may only move such that the distance to the body does not decrease.
    """

    Config = EnvironmentConfig
    name = "environment"
    takes_obstacles = True

    def __init__(self, config: Any, robot: RobotModel, limits: MotionLimits, file: str) -> None:
        super().__init__(config, robot, limits, file)
        self.distances = link_distances(robot, config.geometry)
        joints = {name for name, joint in robot.document.joints.items() if joint.is_moving}
        self._of_world: tuple[Obstacle, ...] = ()
        if config.world is not None:
            from safe_robot.world_obstacles import obstacles_of_world  # loads the simulator

            self._of_world = obstacles_of_world(config.world, joints, config.robot)
        self._links = [link for link in self.distances.links if self.distances.reach((link, 0)).any()]
        self._live: tuple[Obstacle, ...] | None = None
        self._obstacles: tuple[Obstacle, ...] = ()
        try:
            self._update_poses(())
        except ValueError as error:
            raise ConfigError([Problem(config.world, "", str(error))]) from None

    def check(self, motion: CommandedMotion, context: CheckContext) -> Violation | None:
        """See `Check`.

        Raises:
            ValueError: If an obstacle has non-finite numbers, or a shape that is not supported.
        """
        if (violation := self.undefined(motion)) is not None:
            return violation
        if context.obstacles is None and self.config.world is None:
            return Violation(self.name, "there is no source of bodies around the robot", math.nan, math.nan, "")
        live = context.obstacles or ()
        if live is not self._live:
            self._update_poses(live)
        return self.too_near(motion)

    def subject(self, pair: Pair) -> str:
        """See `ProximityCheck`."""
        return f"link '{pair[0]}' and '{self._obstacles[int(pair[1])].name}'"

    def _update_poses(self, live: tuple[Obstacle, ...]) -> None:
        """Replaces the obstacles of `CheckContext`, and discards stored distances to obstacles that have changed.

        Raises:
            ValueError: If an obstacle is invalid; see `check`.
        """
        self._live = None  # marks the poses as outdated until all are updated
        count = len(self._obstacles)
        obstacles = (*self._of_world, *live)
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
