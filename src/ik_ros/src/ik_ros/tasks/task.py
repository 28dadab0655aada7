"""The interface of tasks."""

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
    """Options of every task.

    Attributes:
        name: Its name in problems and messages.
        type: A name of the table, or `their_package.module:Class`.
        weight: Factor on its square, for a cost.
        required: For a cost, whether success requires it.
        tolerance_m: Largest error at which it counts as met [m].
        tolerance_rad: The same for angles [rad], and for positions of joints [rad or m].
    """

    name: Text
    type: Text
    weight: Positive = 1.0
    required: Switch = False
    tolerance_m: Positive = POSITION_TOLERANCE_M
    tolerance_rad: Positive = ORIENTATION_TOLERANCE_RAD


@contextmanager
def keyed_errors(key: str) -> Iterator[None]:
    """Converts errors of unknown names and wrong values to a `KeyedError` of an option, or of keys inside it."""
    try:
        yield
    except KeyedError as error:
        raise KeyedError(f"{key}.{error.key}", error.message) from None
    except (UnknownNameError, ValueError) as error:
        raise KeyedError(key, str(error)) from None


class Linearization(NamedTuple):
    """k task values with bounds, linearised at one configuration.

    Attributes:
        values: k task values [m or rad].
        jacobian: Their derivatives by the free components, k x m.
        lower: k lower bounds, -inf where there is none.
        upper: k upper bounds, inf where there is none; the same array as `lower` if all bounds are equal.
    """

    values: np.ndarray
    jacobian: np.ndarray
    lower: np.ndarray
    upper: np.ndarray

    @property
    def is_exact(self) -> bool:
        """Whether it has exact values instead of ranges."""
        return self.lower is self.upper

    def beyond(self) -> np.ndarray:
        """Returns the violation of the bounds, k numbers."""
        if self.is_exact:
            return self.values - self.lower
        return self.values - np.minimum(np.maximum(self.values, self.lower), self.upper)


class Task(ABC):
    """A requirement on a configuration: a cost to minimise, or a constraint to satisfy.

    The options of a subclass are its `Config`, in YAML. One thread at a time calls `begin`, and then `rows` for each
    candidate configuration.

    Args:
        config: Its options.
        robot: The robot; `rows` is called with the configuration set.

    Raises:
        KeyedError: If an option does not fit the robot; it names the key.
    """

    Config: ClassVar[type[TaskConfig]] = TaskConfig

    def __init__(self, config: TaskConfig, robot: PinocchioRobot) -> None:
        self.config = config
        self.robot = robot

    def begin(self, problem: IKProblem, goal: Sequence[float] | None, q: np.ndarray) -> None:
        """Prepares the task for a problem.

        Args:
            problem: The problem.
            goal: Goal of this task; None: that of the formulation.
            q: The configuration where the search starts.

        Raises:
            ValueError: If the goal makes no sense, or there is none.
            KeyedError: If another field of the problem does not fit; it names the field.
        """
        if goal is not None:
            raise ValueError("this task has no goal")

    @abstractmethod
    def rows(self, q: np.ndarray) -> Linearization:
        """Returns the linearised task at one configuration."""

    def residual(self, beyond: np.ndarray) -> Residual:
        """Returns the residual for k violations of the bounds [m or rad]; by default all are lengths."""
        return Residual(math.hypot(*beyond.tolist()), 0.0)

    def size(self, residual: Residual) -> float:
        """Returns a residual as a multiple of the tolerances: up to 1, the task is met."""
        return max(residual.position_m / self.config.tolerance_m, residual.orientation_rad / self.config.tolerance_rad)
