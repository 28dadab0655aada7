"""Base class of the tasks of the solver `tasks`."""

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import ClassVar, NamedTuple

import numpy as np

from custom_ros_tools.errors import UnknownNameError
from custom_ros_tools.schema import ConfigModel, KeyedError, Positive, Switch, Text
from ik_ros.problem import IKProblem
from robot_model.reach import ORIENTATION_TOLERANCE_RAD, POSITION_TOLERANCE_M, Residual

from .robot import PinocchioRobot


class TaskConfig(ConfigModel):
    """Options that every task has.

    Attributes:
        name: Name of the task in problems and messages.
        type: Type of the task: a name in the table of tasks, or `their_package.module:Class`.
        weight: For a cost, factor of the squared error.
        required: For a cost, whether a solution counts as successful only if the task is met.
        tolerance_m: Largest position error at which the task counts as met [m].
        tolerance_rad: Largest angle error [rad], or joint position error [rad or m], at which the task counts as met.
    """

    name: Text
    type: Text
    weight: Positive = 1.0
    required: Switch = False
    tolerance_m: Positive = POSITION_TOLERANCE_M
    tolerance_rad: Positive = ORIENTATION_TOLERANCE_RAD


@contextmanager
def keyed_errors(key: str) -> Iterator[None]:
    """Context that converts errors to a `KeyedError` for the option `key`, or for a key inside the option."""
    try:
        yield
    except KeyedError as error:
        raise KeyedError(f"{key}.{error.key}", error.message) from None
    except (UnknownNameError, ValueError) as error:
        raise KeyedError(key, str(error)) from None


class Linearization(NamedTuple):
    """The k values of a task, linearised at one configuration, and the bounds of the values.

    Attributes:
        values: k task values [m or rad].
        jacobian: Derivatives of the values with respect to the m components in `PinocchioRobot.free`, k x m.
        lower: k lower bounds; -inf for values without a lower bound.
        upper: k upper bounds; inf for values without an upper bound. If the task prescribes exact values, `upper` and
            `lower` are the same array object.
    """

    values: np.ndarray
    jacobian: np.ndarray
    lower: np.ndarray
    upper: np.ndarray

    @property
    def is_exact(self) -> bool:
        """Whether the task prescribes exact values instead of ranges."""
        return self.lower is self.upper

    def beyond(self) -> np.ndarray:
        """Returns the amount by which each value exceeds its upper bound (positive) or lower bound (negative)."""
        if self.is_exact:
            return self.values - self.lower
        return self.values - np.minimum(np.maximum(self.values, self.lower), self.upper)


class Task(ABC):
    """A requirement on a configuration: a cost to minimise, or a constraint to satisfy.

    A subclass declares its YAML options in `Config`. One thread at a time calls `begin` for a problem, and then `rows`
    for each candidate configuration.

    Args:
        config: The options.
        robot: The robot. The solver calls `update` of the robot before each call of `rows`.

    Raises:
        KeyedError: If an option does not fit the robot; the error names the key.
    """

    Config: ClassVar[type[TaskConfig]] = TaskConfig

    def __init__(self, config: TaskConfig, robot: PinocchioRobot) -> None:
        self.config = config
        self.robot = robot

    def begin(self, problem: IKProblem, goal: Sequence[float] | None, q: np.ndarray) -> None:
        """Prepares the task for a problem.

        Args:
            problem: The problem.
            goal: The problem's goal for this task. None: the goal in the task's options is used.
            q: The configuration where the search starts.

        Raises:
            ValueError: If the goal is invalid or missing.
            KeyedError: If another field of the problem is invalid; the error names the field.
        """
        if goal is not None:
            raise ValueError("this task has no goal")

    @abstractmethod
    def rows(self, q: np.ndarray) -> Linearization:
        """Returns the values of the task, their derivatives and their bounds at a configuration."""

    def residual(self, beyond: np.ndarray) -> Residual:
        """Converts k bound violations [m or rad] to a residual; by default, all violations count as lengths."""
        return Residual(math.hypot(*beyond.tolist()), 0.0)

    def size(self, residual: Residual) -> float:
        """Returns a residual as a multiple of the task's tolerances. The task counts as met up to a multiple of 1."""
        return max(residual.position_m / self.config.tolerance_m, residual.orientation_rad / self.config.tolerance_rad)
