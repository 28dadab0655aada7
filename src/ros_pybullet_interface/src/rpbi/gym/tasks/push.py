"""The task `push`."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from pydantic import Field

from custom_ros_tools.schema import Name, Position, PositiveMetres
from rpbi.gym.actions import ActionPart
from rpbi.gym.parts import ObservationPart, pose_part
from rpbi.world import World

from .hand import HandConfig, HandTask


class PushConfig(HandConfig):
    """Options of the task `push`."""

    object: Name = Field(description="Name of the body that is pushed.")
    goal_low: Position = Field(
        description="Lower corner of the region in which goals are drawn, in the world frame; z is not used."
    )
    goal_high: Position = Field(
        description="Upper corner of the region in which goals are drawn, in the world frame; z is not used."
    )
    tolerance: PositiveMetres = Field(
        0.03, description="Distance of the body from the goal below which the goal counts as reached."
    )


class PushTask(HandTask):
    """Pushes a body over the ground to a random goal."""

    Config = PushConfig

    def __init__(self, world: World, config: PushConfig) -> None:
        super().__init__(world, config)
        world.dynamics(config.object)  # checks that it exists
        self.goal: tuple[float, float] = (0.0, 0.0)
        """Goal of the body, x and y in the world [m]."""

    def actions(self) -> Sequence[ActionPart]:
        """Returns the action part for translating the hand horizontally."""
        return [self.hand_action("xy")]

    def parts(self) -> Iterator[ObservationPart]:
        """Yields the parts of `HandTask.parts`, then the pose of the body, then x and y [m] of the goal."""
        yield from super().parts()
        yield pose_part(self.world, self.config.object, self.config.low, self.config.high)
        yield ObservationPart("goal", self.config.goal_low[:2], self.config.goal_high[:2], lambda: self.goal)

    def reset(self, random: np.random.Generator) -> None:
        """Draws a random goal."""
        x, y = random.uniform(self.config.goal_low[:2], self.config.goal_high[:2]).tolist()
        self.goal = x, y
        super().reset(random)

    def distance(self) -> float:
        """Returns the horizontal distance [m] between body and goal."""
        return math.dist(self.goal, self.position_of(self.config.object)[:2])

    def reward(self) -> float:
        """Returns -(distance from body to goal + 0.1 * distance from hand to body) [m]."""
        return -self.distance() - 0.1 * math.dist(self.hand(), self.position_of(self.config.object))

    def has_succeeded(self) -> bool:
        """Returns whether the body is at the goal."""
        return bool(self.distance() <= self.config.tolerance)

    def has_ended(self) -> bool:
        """Returns True if the body is at the goal, or if it is outside the workspace in x or y."""
        position, low, high = self.position_of(self.config.object), self.config.low, self.config.high
        return self.has_succeeded() or not all(low[i] <= position[i] <= high[i] for i in (0, 1))
