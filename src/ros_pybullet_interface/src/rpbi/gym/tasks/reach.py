"""The task `reach`."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Annotated

import numpy as np
from pydantic import Field

from custom_ros_tools.schema import Fraction, ListOf, Name, Position, PositiveMetres, Text, Unit
from robot_model.geometry import Vector, minus
from rpbi.gym.actions import ActionPart, JointAction
from rpbi.gym.parts import ObservationPart, link_index, robot_of
from rpbi.gym.task import WorldTask, WorldTaskConfig
from rpbi.world import World


class ReachConfig(WorldTaskConfig):
    """Options of the task `reach`."""

    robot: Name = Field(description="Name of the robot.")
    link: Text = Field(description="Link whose frame must reach the goal.")
    joints: ListOf[Text] = Field((), description="Joints that actions move. By default, all joints with motors.")
    speed: Annotated[Fraction, Unit("share of the limits")] = Field(
        0.5, description="Largest joint speed in an action."
    )
    goal_low: Position = Field(description="Lower corner of the box in which goals are drawn, in the world frame.")
    goal_high: Position = Field(description="Upper corner of the box in which goals are drawn, in the world frame.")
    tolerance: PositiveMetres = Field(
        0.03, description="Distance of the link from the goal below which the goal counts as reached."
    )


class ReachTask(WorldTask):
    """Moves joints until a link is at a random goal."""

    Config = ReachConfig

    def __init__(self, world: World, config: ReachConfig) -> None:
        super().__init__(world, config)
        self._link = link_index(robot_of(world, config.robot), config.link)
        self.goal: Vector = (0.0, 0.0, 0.0)
        """The goal in the world [m]."""

    def actions(self) -> Sequence[ActionPart]:
        """Returns the action part for changing joint targets."""
        config = self.config
        return [JointAction(self.world, config.robot, config.joints, config.speed, self.period_s)]

    def parts(self) -> Iterator[ObservationPart]:
        """Yields the parts of `WorldTask.parts`, then the vector [m] from the link to the goal, in world axes."""
        yield from super().parts()
        yield ObservationPart("way", (-2.0,) * 3, (2.0,) * 3, lambda: minus(self.goal, self.position()))

    def reset(self, random: np.random.Generator) -> None:
        """Draws a random goal."""
        x, y, z = random.uniform(self.config.goal_low, self.config.goal_high).tolist()
        self.goal = x, y, z
        super().reset(random)

    def position(self) -> Vector:
        """Returns the position [m] of the link in the world frame."""
        position: Vector = self.world.bodies[self.config.robot].link_pose(self._link).position
        return position

    def reward(self) -> float:
        """Returns the negative distance [m] between link and goal."""
        return -math.dist(self.goal, self.position())

    def has_succeeded(self) -> bool:
        """Returns whether the link is at the goal."""
        return bool(math.dist(self.goal, self.position()) <= self.config.tolerance)
