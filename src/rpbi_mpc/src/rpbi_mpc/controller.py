"""The interface of controllers: measurements in, plans out."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field

import numpy as np

from .plant import Sensed


@dataclass(frozen=True)
class ControlPlan:
    """Commands for the next cycles, and what is expected to happen.

    Attributes:
        commands: Commands of this cycle and those after it, cycles x numbers of a command.
        states: Predicted states, from the time at which the first command acts; rows x numbers of a state.
        state_step_s: Time between two predicted states [s].
        cost: Value of the cost.
        converged: Whether the solver found a solution within its limits.
        status: Its answer, or the reason why there is none.
        iterations: Number of its iterations.
        wall_s: Time that it took [s].
        processor_s: Time of the processor [s].
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
    """Plans from measurements; the loop executes the first command of each plan.

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
        """Returns a plan; it depends on the measurements since `reset` alone, not on time or chance.

        Args:
            sensed: A complete measurement.
            delay_s: Time from `sensed.time_s` until the first command acts [s].
        """

    def executed(self, time_s: float, command: np.ndarray | None) -> None:  # noqa: B027 (may stay as it is)
        """Takes note of the command that acts from a time on [s]; None if the plant stands."""

    def reset(self) -> None:  # noqa: B027 (may stay as it is)
        """Forgets everything of the past; the next plan is that of a new controller."""

    @property
    def is_finished(self) -> bool:
        """Whether the task is done; the loop then ends."""
        return False

    @property
    def result(self) -> str:
        """A clause on the task that is done."""
        return "the task is done"

    @property
    def failure(self) -> str:
        """Reason why the task cannot be done any more, with which the loop stops; empty while it can."""
        return ""
