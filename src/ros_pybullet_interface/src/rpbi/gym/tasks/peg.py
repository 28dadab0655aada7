"""The task `peg`."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from pydantic import Field

from custom_ros_tools.schema import ListOf, Name, NonNegativeMetres, Position, PositiveMetres
from robot_model.geometry import Vector, minus, plus
from rpbi.geometry import Pose
from rpbi.gym.actions import ActionPart
from rpbi.gym.parts import ObservationPart
from rpbi.world import World

from .hand import HandConfig, HandTask


class PegConfig(HandConfig):
    """Options of the task `peg`."""

    walls: ListOf[Name] = Field(
        min_length=1, description="Names of the bodies around the hole, which move with the hole."
    )
    hole: Position = Field(description="Middle of the hole's opening, in the world frame.")
    hole_offset: NonNegativeMetres = Field(0.02, description="Largest random offset of the hole along x and y.")
    half_width: PositiveMetres = Field(description="Half the width of the hole.")
    depth: PositiveMetres = Field(
        0.03, description="Depth of the peg's tip in the hole at which the peg counts as inserted."
    )


class PegTask(HandTask):
    """Inserts a peg into a hole. The link that serves as the hand must be at the tip of the peg."""

    Config = PegConfig

    def __init__(self, world: World, config: PegConfig) -> None:
        super().__init__(world, config)
        for name in config.walls:
            world.dynamics(name)  # checks that it exists
        self.hole: Vector = config.hole
        """Middle of the hole's opening, in the world [m]."""

    def actions(self) -> Sequence[ActionPart]:
        """Returns the action part for translating the hand."""
        return [self.hand_action()]

    def parts(self) -> Iterator[ObservationPart]:
        """Yields the parts of `HandTask.parts`, then the vector [m] from peg tip to hole opening, in world axes."""
        yield from super().parts()
        yield ObservationPart("way", (-2.0,) * 3, (2.0,) * 3, lambda: minus(self.hole, self.hand()))

    def reset(self, random: np.random.Generator) -> None:
        """Moves the hole, with its walls, by a random offset."""
        x, y = random.uniform(-self.config.hole_offset, self.config.hole_offset, 2).tolist()
        self.hole = plus(self.config.hole, (x, y, 0.0))
        for name in self.config.walls:
            position, quat = self.world.bodies[name].base_pose()
            self.world.act(name, "teleport", Pose(plus(position, (x, y, 0.0)), quat))
        super().reset(random)

    def reward(self) -> float:
        """Returns the negative distance [m] between the tip and the target point in the hole."""
        return -math.dist(minus(self.hole, (0.0, 0.0, self.config.depth)), self.hand())

    def has_succeeded(self) -> bool:
        """Returns whether the tip is between the walls and deep enough in the hole."""
        x, y, z = minus(self.hand(), self.hole)
        return bool(max(abs(x), abs(y)) <= self.config.half_width and z <= -self.config.depth)
