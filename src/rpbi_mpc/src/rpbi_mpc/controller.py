"""Controllers and the plants that they control: measurements in, plans and commands out."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np


class Sensed(NamedTuple):
    """A measurement.

    Attributes:
        time_s: Plant time at which the measurement is available [s].
        values: The measured numbers, in the order and units that the controller expects; None if a number is missing.
        missing: What is missing, as a clause such as `vicon/box/box: no pose for 0.52 s, expected one every 0.01 s`.
        age_s: Time from the instant of measurement to `time_s` [s].
    """

    time_s: float
    values: np.ndarray | None
    missing: str = ""
    age_s: float = 0.0


class Plant(ABC):
    """A system that is measured and commanded, and that advances in time.

    Attributes:
        is_timed: Whether the plant runs in real time, as hardware does. If so, late plans are discarded; otherwise the
            plant waits for plans, and no decision depends on the speed of the computer.
    """

    is_timed = False

    @abstractmethod
    def sense(self) -> Sensed:
        """Returns the newest measurement."""

    @abstractmethod
    def act(self, command: np.ndarray) -> None:
        """Applies a command until the next one."""

    @abstractmethod
    def stand(self) -> None:
        """Stops the plant until the next command."""

    @abstractmethod
    def advance(self, duration_s: float) -> None:
        """Lets the given time pass: a simulation is stepped by the corresponding ticks; on hardware, the call waits."""


@dataclass(frozen=True)
class ControlPlan:
    """Commands for the next cycles, and the predicted states.

    Attributes:
        commands: Commands of this and the following cycles, shape (cycles, numbers of a command).
        states: Predicted states, from the time at which the first command acts, shape (rows, numbers of a state).
        state_step_s: Time between two predicted states [s].
        cost: Value of the cost.
        converged: Whether the solver found a solution within its limits.
        status: Status that the solver reports, or the reason why there is no solution.
        iterations: Number of solver iterations.
        wall_s: Wall time that the solver took [s].
        processor_s: Processor time that the solver took [s].
        extras: Further numbers of this cycle for the table of cycles, indexed by name.
    """

    commands: np.ndarray
    states: np.ndarray
    state_step_s: float
    cost: float
    converged: bool
    status: str = ""
    iterations: int = 0
    wall_s: float = 0.0
    processor_s: float = 0.0
    extras: dict[str, float] = field(default_factory=dict)


class MpcController(ABC):
    """Makes plans from measurements; the loop executes the first command of each plan.

    Attributes:
        measured_names: Names of the numbers that a plant measures.
        command_names: Names of the numbers of a command.
        state_names: Names of the numbers of a predicted state.
    """

    measured_names: tuple[str, ...]
    command_names: tuple[str, ...]
    state_names: tuple[str, ...]

    @abstractmethod
    def plan(self, sensed: Sensed, delay_s: float) -> ControlPlan:
        """Returns a plan. It depends only on the measurements since `reset`, not on wall time or random numbers.

        Args:
            sensed: A complete measurement.
            delay_s: Time from `sensed.time_s` until the first command acts [s].
        """

    def executed(self, time_s: float, command: np.ndarray | None) -> None:  # noqa: B027 (optional)
        """Records the command that acts from `time_s` [s] on; None if the plant is stopped."""

    def reset(self) -> None:  # noqa: B027 (optional)
        """Discards all history, so that the next plan equals the first plan of a new controller."""

    @property
    def is_finished(self) -> bool:
        """Whether the task is done; the loop then ends."""
        return False

    @property
    def result(self) -> str:
        """Result of a finished task, as a clause such as `the task is done`."""
        return "the task is done"

    @property
    def failure(self) -> str:
        """Reason why the task has failed, for which the loop stops; empty while the task can succeed."""
        return ""
