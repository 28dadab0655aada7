"""A plant that is a world in this process. Forks of the world simulate candidates."""

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
    """Selects the input of the world that the controller commands, and limits the commanded numbers."""

    input: str = Field(description="Input of the world: NAME/INPUT, such as kuka_lwr/target.")
    names: ListOf[str] = Field(description="Joints, or fields of the input's value, that are commanded.")
    lower: ListOf[float] = Field(description="Lower limit of each commanded number.")
    upper: ListOf[float] = Field(description="Upper limit of each commanded number.")
    start: ListOf[float] = Field((), description="Initial command. By default, the middle between the limits.")

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
        """Initial command: `start`, or by default the middle between the limits."""
        return self.start or tuple((np.add(self.lower, self.upper) / 2.0).tolist())


def planned(commands: np.ndarray, config: InputConfig, period_ticks: int, delay_ticks: int) -> list[PlannedInput]:
    """Converts the commands of a candidate to planned inputs.

    Args:
        commands: Commands, shape (cycles, m).
        config: Input and names of the m numbers.
        period_ticks: Duration of each command in ticks.
        delay_ticks: Tick at which the first command acts.
    """
    return [
        PlannedInput(delay_ticks + index * period_ticks, config.input, dict(zip(config.names, row, strict=True)))
        for index, row in enumerate(commands.tolist())
    ]


def whole_ticks(duration_s: float, dt_s: float) -> int:
    """Converts a duration [s] to a number of ticks.

    Raises:
        InterfaceError: If the duration is not a whole number of ticks.
    """
    ticks = round(duration_s / dt_s)
    if abs(ticks * dt_s - duration_s) > 1e-9:
        raise InterfaceError(f"expected a whole number of ticks of {dt_s:g} s, got {duration_s:g} s")
    return ticks


class RolloutTicks(NamedTuple):
    """Timing of a prediction in which n commands act one after the other.

    The prediction returns a row with the state after every `every` ticks.

    Attributes:
        starts: First tick of each command, shape (n,).
        total: Number of ticks in the prediction.
        every: Number of ticks between two rows.
        rows: Index of the row at the end of each command, shape (n,).
    """

    starts: np.ndarray
    total: int
    every: int
    rows: np.ndarray

    @classmethod
    def of(cls, commands: int, period_s: float, delay_s: float, dt_s: float) -> RolloutTicks:
        """Computes the ticks of a prediction.

        Args:
            commands: Number n of commands.
            period_s: Duration of each command [s].
            delay_s: Time until the first command acts [s].
            dt_s: Duration of a tick [s].

        Raises:
            InterfaceError: If period or delay is not a whole number of ticks.
        """
        period, delay = whole_ticks(period_s, dt_s), whole_ticks(delay_s, dt_s)
        starts, every = delay + period * np.arange(commands), math.gcd(period, delay)
        return cls(starts, delay + period * commands, every, (starts + period) // every - 1)


class ForkedWorld(Plant):
    """A plant that is a `World` in this process. Forks of the world simulate candidates.

    Args:
        world: The world.
        config: Commanded input.
        cost: Cost of a state, which is summed over all ticks, as `module:name`. `name` is a function that takes the
            `World`, or a class whose instances can be called with the `World`.

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
        """Does nothing: the last command continues to act, so that a robot stays at its target."""

    def advance(self, duration_s: float) -> None:
        for _ in range(whole_ticks(duration_s, self.world.clock.dt_s)):
            self.world.step()

    def costs(self, commands: np.ndarray, period_s: float, delay_s: float) -> np.ndarray:
        """Simulates candidates, and returns the cost of each candidate; see `Rollouts`."""
        dt_s = self.world.clock.dt_s
        period, delay = whole_ticks(period_s, dt_s), whole_ticks(delay_s, dt_s)
        candidates: Sequence[list[PlannedInput]] = [planned(each, self._config, period, delay) for each in commands]
        ticks = delay + commands.shape[1] * period
        found = self.world.predict(candidates, ticks, watch=(), every=ticks, cost=self._cost)
        return np.array([each.cost for each in found])
