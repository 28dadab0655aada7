"""Controllers and the plants that they control: measurements in, plans and commands out."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np


class Sensed(NamedTuple):
    """A measurement.

    Attributes:
        time_s: Time of the plant at which it is available [s].
        values: The measured numbers, in the order and units of the controller; None if something is missing.
        missing: What is missing, as a clause such as `vicon/box/box: no pose for 0.52 s, expected one every 0.01 s`.
        age_s: Time between measurement and `time_s` [s].
    """

    time_s: float
    values: np.ndarray | None
    missing: str = ""
    age_s: float = 0.0


class Plant(ABC):
    """A system that is measured and commanded, and that advances in time.

    Attributes:
        is_timed: Whether it runs in real time, as hardware does. Then late plans are discarded; otherwise the plant
            waits, and no decision depends on the speed of the computer.
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
        """Lets time pass: steps a simulation by as many ticks, or waits on hardware."""


@dataclass(frozen=True)
class ControlPlan:
    """Commands for the next cycles, and the predicted states.

    Attributes:
        commands: Commands of this cycle and those after it, cycles x numbers of a command.
        states: Predicted states, from the time at which the first command acts; rows x numbers of a state.
        state_step_s: Time between two predicted states [s].
        cost: Value of the cost.
        converged: Whether the solver found a solution within its limits.
        status: Status of the solver, or the reason why there is none.
        iterations: Number of its iterations.
        wall_s: Wall time of the solution [s].
        processor_s: Processor time [s].
        extras: Further numbers of this cycle, by name, for the table.
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
        """Records the command that acts from a time on [s]; None if the plant is stopped."""

    def reset(self) -> None:  # noqa: B027 (optional)
        """Discards all history; the next plan is that of a new controller."""

    @property
    def is_finished(self) -> bool:
        """Whether the task is done; the loop then ends."""
        return False

    @property
    def result(self) -> str:
        """Result of a finished task, as a clause."""
        return "the task is done"

    @property
    def failure(self) -> str:
        """Reason of a failed task, with which the loop stops; empty while the task can succeed."""
        return ""
