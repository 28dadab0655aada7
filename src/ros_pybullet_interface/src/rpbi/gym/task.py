"""Base class of tasks."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import Annotated, Any, ClassVar

import numpy as np
from gymnasium import spaces
from pydantic import Field

from custom_ros_tools.schema import ConfigModel
from rpbi.bodies.robots.robot import Robot
from rpbi.world import World

from .actions import ActionPart
from .parts import ObservationPart, Parts, joint_part, sensor_parts


class WorldTaskConfig(ConfigModel):
    """Options of every task."""

    action_ticks: Annotated[int, Field(ge=1, le=10_000)] = Field(
        40, description="Number of ticks of the world for each action."
    )
    max_actions: Annotated[int, Field(ge=1, le=10_000_000)] = Field(
        100, description="Number of actions after which an episode is truncated."
    )


class WorldTask(ABC):
    """A task in a world: observation, action, reward, end and success.

    A new task is a subclass with a `Config`, `actions`, `reward` and `has_succeeded`; the other members have defaults.
    Look up bodies in the world each time they are needed, since a reset may recreate them.

    Args:
        world: The world, before its first tick.
        config: Options of the task.

    Raises:
        ConfigError, UnknownNameError or ValueError: If the options do not fit the world.
    """

    Config: ClassVar[type[WorldTaskConfig]] = WorldTaskConfig
    needs_action: ClassVar[bool] = True
    """Whether every step needs an action from the action space; otherwise the action may also be None."""

    def __init__(self, world: World, config: Any) -> None:
        self.world, self.config = world, config

    @property
    def period_s(self) -> float:
        """Duration of an action [s]."""
        return float(self.config.action_ticks * self.world.clock.dt_s)

    @property
    def max_actions(self) -> int:
        """Number of actions after which an episode is truncated."""
        return int(self.config.max_actions)

    # --- Spaces

    @abstractmethod
    def actions(self) -> Sequence[ActionPart]:
        """Returns the parts of an action, in the order in which their values appear in the action array."""

    def parts(self) -> Iterator[ObservationPart]:
        """Yields the parts of an observation: by default joints and force-torque sensors of all robots."""
        for name, body in self.world.bodies.items():
            if isinstance(body, Robot):
                yield joint_part(self.world, name)
                yield from sensor_parts(self.world, name)

    @cached_property
    def _parts(self) -> Parts:
        return Parts(list(self.parts()))

    @cached_property
    def _actions(self) -> Sequence[ActionPart]:
        return self.actions()

    @cached_property
    def action_space(self) -> spaces.Space[Any]:
        """Space of actions: by default numbers in [-1, 1], float32."""
        return spaces.Box(-1.0, 1.0, (sum(part.size for part in self._actions),), np.float32)

    @cached_property
    def observation_space(self) -> spaces.Space[Any]:
        """Space of observations, without images: by default the space of the parts."""
        return self._parts.space

    # --- An episode

    def reset(self, random: np.random.Generator) -> None:
        """Prepares an episode in the world, which was just reset.

        A subclass that overrides this method calls the base class's method last, after it has placed bodies.

        Args:
            random: Source of all random numbers.
        """
        for part in self._actions:
            part.reset()

    def act(self, action: Any) -> None:
        """Applies an action with `world.put` and `world.act`, before the first tick of the action."""
        values = np.minimum(np.maximum(np.asarray(action, np.float64), -1.0), 1.0)
        begin = 0
        for part in self._actions:
            part.apply(values[begin : begin + part.size])
            begin += part.size

    def after_tick(self) -> None:  # noqa: B027 (most tasks need nothing)
        """Evaluates the last tick. Is called after every tick if a subclass overrides this method."""

    def observation(self) -> Any:
        """Returns the present observation."""
        return self._parts.read()

    @abstractmethod
    def reward(self) -> float:
        """Returns the reward of the last action, computed from the present state. Is called once per action."""

    @abstractmethod
    def has_succeeded(self) -> bool:
        """Returns whether the task is done. A subclass decides this from the simulation state, not from the reward."""

    def has_ended(self) -> bool:
        """Returns whether the episode is over; by default, it is over when the task is done."""
        return self.has_succeeded()
