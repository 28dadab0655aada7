"""A controller that simulates candidate plans from the present state, and plans from the candidates' costs."""

from __future__ import annotations

import time
from typing import Annotated, Any, Protocol

import numpy as np
from pydantic import Field

from custom_ros_tools.schema import ConfigModel, Seconds, Text
from rpbi_mpc.controller import ControlPlan, MpcController, Sensed

from .samplers import SAMPLERS


class Rollouts(Protocol):
    """Simulates candidates from the present state of a world, without changing this state.

    Attributes:
        names: Names of the m numbers in a command.
        lower: Lower limit of each number, shape (m,).
        upper: Upper limit of each number, shape (m,).
    """

    names: tuple[str, ...]
    lower: np.ndarray
    upper: np.ndarray

    def costs(self, commands: np.ndarray, period_s: float, delay_s: float) -> np.ndarray:
        """Simulates candidates, and returns the cost of each candidate. A failed simulation has the cost inf.

        Args:
            commands: Commands of each candidate, shape (candidates, cycles, m).
            period_s: Duration of each command [s].
            delay_s: Time until the first command acts [s].
        """


class SamplingConfig(ConfigModel):
    """Options of a controller that simulates candidate plans.

    A plan consists of commands at a few times, the knots. The sampler draws the candidates.
    """

    horizon: Seconds = Field(0.5, description="Duration of the simulated plans.")
    knots: Annotated[int, Field(ge=2)] = Field(
        2,
        description="Number of knots of a plan; commands are linear between two knots. More knots need more "
        "candidates.",
    )
    seed: int = Field(0, description="Seed of the random candidates.")
    sampler: dict[Text, Any] = Field(
        {"type": "predictive"},
        description="Sampler: its `type` (`predictive`, `cem`, `mppi`, or `module:Class` of your own) and the "
        "options of this type.",
    )


class SamplingController(MpcController):
    """Plans by simulating candidates. A sampler of `SAMPLERS` draws the candidates and improves the plan.

    Random numbers depend only on the seed and the number of the cycle.

    Args:
        rollouts: Simulates the candidates.
        config: Options.
        hz: Rate of the cycles [Hz]; must equal the loop's rate.
        start: Initial command, shape (m,).

    Raises:
        ConfigError: If an option is invalid.
        UnknownNameError: If the sampler does not exist.
    """

    def __init__(self, rollouts: Rollouts, config: SamplingConfig, hz: float, start: np.ndarray) -> None:
        self.measured_names = ("time",)
        self.command_names = rollouts.names
        self.state_names = ()
        self._rollouts, self._config, self._period_s = rollouts, config, 1.0 / hz
        self._cycles = max(round(config.horizon * hz), 1)
        self._times = np.linspace(0.0, config.horizon, config.knots)
        options = dict(config.sampler)
        sampler = SAMPLERS.find(str(options.pop("type", "predictive")))
        self._sampler = sampler(sampler.Config.parse(options, "sampler"), (config.knots, len(rollouts.names)))
        self._span = rollouts.upper - rollouts.lower
        self._start = np.clip((np.asarray(start, dtype=float) - rollouts.lower) / self._span, 0.0, 1.0)
        self.reset()

    def reset(self) -> None:
        self._nominal = np.tile(self._start, (self._config.knots, 1))
        self._count = 0

    def plan(self, sensed: Sensed, delay_s: float) -> ControlPlan:
        return self.sample(delay_s)

    def sample(self, delay_s: float) -> ControlPlan:
        """Improves the plan with simulations from the present state, and returns the improved plan.

        Args:
            delay_s: Time until the plan's first command acts [s].
        """
        begin_s, begin_cpu_s = time.perf_counter(), time.process_time()
        random = np.random.default_rng([self._config.seed, self._count])
        self._count += 1
        self._sampler.begin()
        lost = 0
        for iteration in range(self._sampler.config.iterations):
            candidates = self._sampler.draw(self._nominal, random)
            costs = self._rollouts.costs(self._commands(candidates), self._period_s, delay_s)
            good = np.isfinite(costs)
            lost += int((~good).sum())
            if not good.any():
                return self._failed(iteration, begin_s, begin_cpu_s)
            self._nominal = self._sampler.improve(candidates[good], costs[good])
        plan = self._commands(self._nominal[np.newaxis])[0]
        self._nominal = self._at(self._nominal, self._times + self._period_s)
        return ControlPlan(
            commands=plan,
            states=np.empty((0, 0)),
            state_step_s=self._period_s,
            cost=float(costs[good].min()),
            converged=True,
            status="sampled",
            iterations=self._sampler.config.iterations,
            wall_s=time.perf_counter() - begin_s,
            processor_s=time.process_time() - begin_cpu_s,
            extras={"spread": float(np.ptp(costs[good])), "not_simulated": float(lost)},
        )

    def _failed(self, iteration: int, begin_s: float, begin_cpu_s: float) -> ControlPlan:
        return ControlPlan(
            commands=np.empty((0, len(self.command_names))),
            states=np.empty((0, 0)),
            state_step_s=self._period_s,
            cost=np.inf,
            converged=False,
            status="no candidate could be simulated",
            iterations=iteration + 1,
            wall_s=time.perf_counter() - begin_s,
            processor_s=time.process_time() - begin_cpu_s,
        )

    def _commands(self, plans: np.ndarray) -> np.ndarray:
        """Converts plans, shape (plans, k, m), to commands, shape (plans, cycles, m).

        The numbers of a plan are shares of the range between the limits; see `samplers`.
        """
        times = np.arange(self._cycles) * self._period_s
        shares = np.stack([self._at(plan, times) for plan in plans])
        commands: np.ndarray = self._rollouts.lower + shares * self._span
        return commands

    def _at(self, plan: np.ndarray, times: np.ndarray) -> np.ndarray:
        """Interpolates a plan at times since the start of the plan [s]. Times after the plan's end use the last knot.

        Returns:
            Shares of the range between the limits, shape (times, m).
        """
        return np.stack([np.interp(times, self._times, column) for column in plan.T], axis=1)
