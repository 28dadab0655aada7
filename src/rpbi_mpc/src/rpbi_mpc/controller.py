"""The interface of controllers: measurements in, plans out."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field

import numpy as np

from .plant import Sensed


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
