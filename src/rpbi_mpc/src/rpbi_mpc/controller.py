"""Interfaces of controllers and plants. A controller computes plans of commands from the plant's measurements."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np


class Sensed(NamedTuple):
    """A measurement of a plant.

    Attributes:
        time_s: Plant time at which the measurement is available [s].
        values: The measured numbers, in the order and units that the controller expects. None if a number is missing.
        missing: Clause that names the missing number, such as `vicon/box/box: no pose for 0.52 s, expected one every
            0.01 s`. Empty for a complete measurement.
        age_s: Time from the instant of measurement to `time_s` [s].
    """

    time_s: float
    values: np.ndarray | None
    missing: str = ""
    age_s: float = 0.0


class Plant(ABC):
    """A system that a controller measures and commands, in simulation or on hardware.

    Attributes:
        is_timed: Whether the plant runs in real time, as hardware does. The loop discards late plans for a timed plant.
            Other plants wait for plans, so that the result does not depend on the computer's speed.
    """

    is_timed = False

    @abstractmethod
    def sense(self) -> Sensed:
        """Returns the newest measurement."""

    @abstractmethod
    def act(self, command: np.ndarray) -> None:
        """Applies a command, which acts until the next command."""

    @abstractmethod
    def stand(self) -> None:
        """Stops the plant until the next command."""

    @abstractmethod
    def advance(self, duration_s: float) -> None:
        """Lets a duration [s] pass: steps a simulation by the corresponding number of ticks, or waits for hardware."""


@dataclass(frozen=True)
class ControlPlan:
    """Commands for the next cycles, and the predicted states.

    Attributes:
        commands: Commands of this and the following cycles, shape (cycles, numbers in a command).
        states: Predicted states, shape (rows, numbers in a state). The first row is the state at the start of the first
            command.
        state_step_s: Time between two predicted states [s].
        cost: Cost of the plan.
        converged: Whether the solver found a solution. If not, the loop does not execute this plan.
        status: Status that the solver reports, or the reason why there is no solution.
        iterations: Number of solver iterations.
        wall_s: Wall time that the solver took [s].
        processor_s: Processor time that the solver took [s].
        extras: Additional numbers for the record of this cycle, indexed by name.
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
    """Makes plans from measurements. The loop executes the first command of each plan.

    Attributes:
        measured_names: Names of the numbers in a measurement.
        command_names: Names of the numbers in a command.
        state_names: Names of the numbers in a predicted state.
    """

    measured_names: tuple[str, ...]
    command_names: tuple[str, ...]
    state_names: tuple[str, ...]

    @abstractmethod
    def plan(self, sensed: Sensed, delay_s: float) -> ControlPlan:
        """Returns a plan. The plan depends only on the measurements since `reset`, not on wall time.

        Args:
            sensed: A complete measurement.
            delay_s: Time from `sensed.time_s` until the first command acts [s].
        """

    def executed(self, time_s: float, command: np.ndarray | None) -> None:  # noqa: B027 (optional)
        """Records a command that acts from `time_s` [s] on. None: the plant is stopped."""

    def reset(self) -> None:  # noqa: B027 (optional)
        """Discards all history, so that the next plan equals the first plan of a new controller."""

    @property
    def is_finished(self) -> bool:
        """Whether the task is done. The loop ends when the task is done."""
        return False

    @property
    def result(self) -> str:
        """Result of a finished task, as a clause such as `the task is done`."""
        return "the task is done"

    @property
    def failure(self) -> str:
        """Reason why the task has failed. Empty while the task can succeed. The loop stops after a failure."""
        return ""
