"""A world in this process as a plant; its forks simulate candidates."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from pydantic import Field, model_validator

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.schema import ConfigModel, KeyedError, ListOf
from rpbi.world import World
from rpbi.world.forks.prediction import PlannedInput
from rpbi_mpc.controller import Plant, Sensed


class InputConfig(ConfigModel):
    """An input of the world that is commanded."""

    input: str = Field(description="NAME/INPUT, such as kuka_lwr/target.")
    names: ListOf[str] = Field(description="Joints, or fields of its value, that are commanded.")
    lower: ListOf[float] = Field(description="Lower limit of each number.")
    upper: ListOf[float] = Field(description="Upper limit of each number.")
    start: ListOf[float] = Field((), description="Command at the start; by default the middle.")

    @model_validator(mode="after")
    def _has_limits_of_all(self) -> InputConfig:
        for key in ("lower", "upper", *(("start",) if self.start else ())):
            numbers = getattr(self, key)
            if len(numbers) != len(self.names) or not np.isfinite(numbers).all():
                raise KeyedError(key, f"expected {len(self.names)} finite numbers, one for each name, got {numbers}")
        if not np.less(self.lower, self.upper).all():
            raise KeyedError("upper", f"expected numbers above those of lower, got {self.upper}")
        return self

    @property
    def middle(self) -> tuple[float, ...]:
        """Command at the start."""
        return self.start or tuple((np.add(self.lower, self.upper) / 2.0).tolist())


def planned(commands: np.ndarray, config: InputConfig, period_ticks: int, delay_ticks: int) -> list[PlannedInput]:
    """Returns the inputs of a candidate by tick; `commands` are cycles x m."""
    return [
        PlannedInput(delay_ticks + index * period_ticks, config.input, dict(zip(config.names, row, strict=True)))
        for index, row in enumerate(commands.tolist())
    ]


def whole_ticks(duration_s: float, dt_s: float) -> int:
    """Returns a duration [s] in ticks.

    Raises:
        InterfaceError: If it is not a whole number of ticks.
    """
    ticks = round(duration_s / dt_s)
    if abs(ticks * dt_s - duration_s) > 1e-9:
        raise InterfaceError(f"expected a whole number of ticks of {dt_s:g} s, got {duration_s:g} s")
    return ticks


class RolloutTicks(NamedTuple):
    """Ticks of a prediction in which commands act one after the other.

    Attributes:
        starts: First tick of each command, n.
        total: Number of ticks.
        every: Ticks between two rows of the prediction.
        rows: Row at the end of each command, n.
    """

    starts: np.ndarray
    total: int
    every: int
    rows: np.ndarray

    @classmethod
    def of(cls, commands: int, period_s: float, delay_s: float, dt_s: float) -> RolloutTicks:
        """Returns the ticks of some commands of a period [s], the first of which acts after a delay [s].

        Raises:
            InterfaceError: If period or delay is not a whole number of ticks.
        """
        period, delay = whole_ticks(period_s, dt_s), whole_ticks(delay_s, dt_s)
        starts, every = delay + period * np.arange(commands), math.gcd(period, delay)
        return cls(starts, delay + period * commands, every, (starts + period) // every - 1)


class ForkedWorld(Plant):
    """A `World` that waits for its controller; its forks simulate candidates.

    Args:
        world: The world.
        config: The input that is commanded.
        cost: Cost of a state, which is summed over all ticks: `module:name` of a function of the `World`, or of a class
            whose objects are called with it.

    Raises:
        InterfaceError: If the world cannot be forked, for instance because of a soft body.
    """

    def __init__(self, world: World, config: InputConfig, cost: str) -> None:
        self.world, self._config, self._cost = world, config, cost
        self.names = config.names
        self.lower, self.upper = np.array(config.lower), np.array(config.upper)
        world.prepare_forks()

    def sense(self) -> Sensed:
        time_s = self.world.clock.tick * self.world.clock.dt_s
        return Sensed(time_s, np.array([time_s]))

    def act(self, command: np.ndarray) -> None:
        self.world.put(self._config.input, dict(zip(self.names, command.tolist(), strict=True)))

    def stand(self) -> None:
        """Keeps the last command, at which a robot holds."""

    def advance(self, duration_s: float) -> None:
        for _ in range(whole_ticks(duration_s, self.world.clock.dt_s)):
            self.world.step()

    def costs(self, commands: np.ndarray, period_s: float, delay_s: float) -> np.ndarray:
        """Returns the cost of each candidate, see `Rollouts`."""
        dt_s = self.world.clock.dt_s
        period, delay = whole_ticks(period_s, dt_s), whole_ticks(delay_s, dt_s)
        candidates: Sequence[list[PlannedInput]] = [planned(each, self._config, period, delay) for each in commands]
        ticks = delay + commands.shape[1] * period
        found = self.world.predict(candidates, ticks, watch=(), every=ticks, cost=self._cost)
        return np.array([each.cost for each in found])
