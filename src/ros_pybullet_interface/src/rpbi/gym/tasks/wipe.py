"""The task `wipe`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Annotated

import numpy as np
from pydantic import Field

from custom_ros_tools.schema import Name, NonNegative, Position, PositiveMetres, Unit
from rpbi.gym.actions import ActionPart
from rpbi.gym.parts import LARGEST_FORCE_N, ObservationPart
from rpbi.world import World

from .hand import HandConfig, HandTask

TICKS = 40
"""Ticks between two checks of the contacts; the hand moves at most half a cell in that time."""


class WipeConfig(HandConfig):
    """Options of the task `wipe`."""

    surface: Name = Field(description="Name of the body that is wiped.")
    spot_low: Position = Field(
        description="Lower corner of the rectangle that must be wiped, in the world frame; z is not used."
    )
    spot_high: Position = Field(
        description="Upper corner of the rectangle that must be wiped, in the world frame; z is not used."
    )
    cells: Annotated[int, Field(ge=1, le=100)] = Field(
        4, description="Number of cells along each side of the rectangle."
    )
    radius: PositiveMetres = Field(
        0.03, description="Distance from the hand up to which the middle of a cell counts as wiped."
    )
    force: Annotated[NonNegative, Unit("N")] = Field(1.0, description="Least normal force with which the hand wipes.")


class WipeTask(HandTask):
    """Wipes a rectangle on a surface: the hand presses on the surface, and passes over all cells of the rectangle."""

    Config = WipeConfig

    def __init__(self, world: World, config: WipeConfig) -> None:
        super().__init__(world, config)
        world.dynamics(config.surface)  # checks that it exists
        low, high = np.array(config.spot_low[:2]), np.array(config.spot_high[:2])
        steps = (np.arange(config.cells) + 0.5) / config.cells
        x, y = np.meshgrid(*(low + np.outer(steps, high - low)).T)
        self.cells = np.stack([x.ravel(), y.ravel()], axis=1)
        """Middles of the cells, x and y in the world [m], shape (n, 2)."""
        self.is_wiped = np.zeros(len(self.cells), bool)
        """Whether each cell was wiped in this episode."""
        self._rewarded = 0.0

    def actions(self) -> Sequence[ActionPart]:
        """Returns the action part for translating the hand."""
        return [self.hand_action()]

    def parts(self) -> Iterator[ObservationPart]:
        """Yields the parts of `HandTask.parts`, the force [N] on the surface, and for each cell 1 if wiped, else 0."""
        yield from super().parts()
        yield ObservationPart("force", (0.0,), (LARGEST_FORCE_N,), lambda: (self.force(),))
        count = len(self.cells)
        yield ObservationPart("wiped", (0.0,) * count, (1.0,) * count, lambda: self.is_wiped.astype(float).tolist())

    def reset(self, random: np.random.Generator) -> None:
        """Marks all cells as not wiped."""
        self.is_wiped[:] = False
        self._rewarded = 0.0
        super().reset(random)

    def force(self) -> float:
        """Returns the normal force [N] of the robot on the surface in the last tick."""
        return sum(force for other, force in self.touches(self.config.surface) if other == self.config.robot)

    def after_tick(self) -> None:
        """Every `TICKS` ticks, marks the cells around the hand as wiped if the hand presses hard enough."""
        if self.world.clock.tick % TICKS == 0 and self.force() >= self.config.force:
            self.is_wiped |= np.linalg.norm(self.cells - self.hand()[:2], axis=1) <= self.config.radius

    def reward(self) -> float:
        """Returns the number of cells that were newly wiped in the last action, divided by the number of all cells."""
        before, self._rewarded = self._rewarded, float(self.is_wiped.mean())
        return self._rewarded - before

    def has_succeeded(self) -> bool:
        """Returns whether all cells were wiped."""
        return bool(self.is_wiped.all())
