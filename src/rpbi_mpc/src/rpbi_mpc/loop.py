"""The control loop in lock-step: each cycle measures the plant, plans, applies a command, and lets time pass."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.schema import ConfigModel, Hz, KeyedError, NonNegative, Unit

from .controller import ControlPlan, MpcController, Plant, Sensed


class LoopConfig(ConfigModel):
    """Timing of a loop.

    Attributes:
        hz: Rate of the cycles [Hz].
        delay_s: Time from a measurement until the resulting command acts [s], at most one cycle. In simulation, the
            delay is always exact. On hardware, the delay is exact if the solver takes at most `delay_s`.
        max_missed: Largest number of successive cycles without a new plan. These cycles execute the last plan. If the
            next cycle has no new plan either, plant and loop stop.
    """

    hz: Hz = Field(25.0, description="Rate of the cycles.")
    delay_s: Annotated[NonNegative, Unit("s")] = Field(
        0.02, description="Time from a measurement until the resulting command acts, at most one cycle."
    )
    max_missed: Annotated[int, Field(ge=0)] = Field(
        5,
        description="Largest number of successive cycles without a new plan. These cycles execute the last plan; "
        "afterwards, the loop stops.",
    )

    @model_validator(mode="after")
    def _acts_within_its_cycle(self) -> LoopConfig:
        if self.delay_s > self.period_s:
            raise KeyedError("delay_s", f"expected at most the {self.period_s:g} s of a cycle, got {self.delay_s:g}")
        return self

    @property
    def period_s(self) -> float:
        """Duration of a cycle [s]."""
        return 1.0 / self.hz


class Status(StrEnum):
    """Outcome of a cycle."""

    SOLVED = "solved"
    LAST_PLAN = "last plan"
    WAITING = "waiting"
    STOPPED = "stopped"
    FINISHED = "finished"


@dataclass(frozen=True)
class Cycle:
    """Record of one cycle of the loop.

    Attributes:
        index: Number of the cycle, counted from 0.
        status: Outcome of the cycle.
        reason: Reason for the status. Empty if the status is `solved`.
        sensed: The measurement.
        plan: The plan of this cycle, also if the solver failed. None without a measurement, and after a stop.
        command: The applied command. None if the plant was stopped.
    """

    index: int
    status: Status
    reason: str
    sensed: Sensed
    plan: ControlPlan | None
    command: np.ndarray | None


@dataclass
class _Held:
    """The last usable plan, and the number of cycles since this plan was made."""

    plan: ControlPlan | None = None
    age: int = 0
    reason: str = field(default="")


class LockStep:
    """Runs the control loop, one cycle at a time: measures the plant, plans, applies the command, and lets time pass.

    The measurement of a cycle determines the command that acts `delay_s` later. A simulated plant waits for the
    solver, so that results do not depend on the computer's speed. A timed plant does not wait: late plans are
    discarded.

    Without a new plan, the last plan is executed for at most `max_missed` cycles; then plant and loop stop. Without a
    measurement, the plant stops until the next measurement.

    Args:
        plant: The controlled system.
        controller: The controller.
        config: Timing. Default: `LoopConfig()`.
        observers: Functions that are called with the record of each cycle, after the cycle's end.

    Raises:
        InterfaceError: If a measurement or a command does not have one number for each name that the controller lists.
    """

    def __init__(
        self,
        plant: Plant,
        controller: MpcController,
        config: LoopConfig | None = None,
        observers: tuple[Callable[[Cycle], None], ...] = (),
    ) -> None:
        self.plant, self.controller = plant, controller
        self.config = config or LoopConfig()
        self.cycles: list[Cycle] = []
        self._observers = observers
        self._held = _Held()
        self._stopped = ""

    @property
    def is_over(self) -> bool:
        """True if the loop has stopped, or if the controller's task is done."""
        return bool(self._stopped) or self.controller.is_finished

    def restart(self) -> None:
        """Discards the last plan and resets the controller, so that the loop can run again after a stop."""
        self._held, self._stopped = _Held(), ""
        self.controller.reset()

    def run(self, max_s: float = math.inf) -> list[Cycle]:
        """Runs cycles until the task is done, the loop stops, or `max_s` [s] have passed. Returns the cycle records."""
        first = len(self.cycles)
        while not self.is_over and (len(self.cycles) - first) * self.config.period_s < max_s - 1e-9:
            self.cycle()
        self.plant.stand()
        return self.cycles[first:]

    def cycle(self) -> Cycle:
        """Runs one cycle, which advances the plant by one period, and returns the cycle's record."""
        sensed = self.plant.sense()
        plan, status, reason = self._decide(sensed)
        command = self._command() if status in (Status.SOLVED, Status.LAST_PLAN) else None
        self.plant.advance(self.config.delay_s)
        if command is None:
            self.plant.stand()
        else:
            self.plant.act(command)
        self.controller.executed(sensed.time_s + self.config.delay_s, command)
        self.plant.advance(self.config.period_s - self.config.delay_s)
        cycle = Cycle(len(self.cycles), status, reason, sensed, plan, command)
        self.cycles.append(cycle)
        for observer in self._observers:
            observer(cycle)
        return cycle

    def _decide(self, sensed: Sensed) -> tuple[ControlPlan | None, Status, str]:
        if self._stopped:
            return None, Status.STOPPED, self._stopped
        if sensed.values is None:
            self._held = _Held()
            return None, Status.WAITING, sensed.missing
        self._check("measurement", sensed.values, self.controller.measured_names)
        plan = self.controller.plan(sensed, self.config.delay_s)
        self._stopped = self.controller.failure
        if self._stopped:
            return plan, Status.STOPPED, self._stopped
        if self.controller.is_finished:
            return plan, Status.FINISHED, self.controller.result
        fault = self._fault_of(plan)
        if not fault:
            self._check("command", plan.commands[0], self.controller.command_names)
            self._held = _Held(plan)
            return plan, Status.SOLVED, ""
        return plan, *self._without(fault)

    def _fault_of(self, plan: ControlPlan) -> str:
        if not plan.converged:
            return f"the solver did not converge: {plan.status} after {plan.iterations} iterations"
        if not (len(plan.commands) and np.isfinite(plan.commands).all()):
            return f"the plan has a command that is no finite number: {plan.status}"
        if self.plant.is_timed and plan.wall_s > self.config.delay_s:
            return f"the solver took {plan.wall_s * 1e3:.1f} ms, expected at most {self.config.delay_s * 1e3:.1f} ms"
        return ""

    def _without(self, fault: str) -> tuple[Status, str]:
        """Returns status and reason of a cycle without a new plan. Stops the loop if the last plan is missing or too
        old.

        Args:
            fault: Reason why a new plan is missing.
        """
        self._held.age += 1
        last = self._held.plan
        if last is not None and self._held.age <= min(self.config.max_missed, len(last.commands) - 1):
            return Status.LAST_PLAN, fault
        missed = "no plan before it" if last is None else f"{self._held.age} cycles without a new plan"
        self._stopped = f"{fault}; {missed}"
        return Status.STOPPED, self._stopped

    def _command(self) -> np.ndarray:
        assert self._held.plan is not None
        command: np.ndarray = self._held.plan.commands[self._held.age]
        return command

    def _check(self, subject: str, numbers: np.ndarray, names: tuple[str, ...]) -> None:
        if np.shape(numbers) != (len(names),):
            raise InterfaceError(f"{subject}: expected {len(names)} numbers ({', '.join(names)}), got {numbers}")
