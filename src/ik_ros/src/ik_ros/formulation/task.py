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
from robot_model.residual import ORIENTATION_TOLERANCE_RAD, POSITION_TOLERANCE_M, Residual

from .robot import PinocchioRobot


class TaskConfig(ConfigModel):
    """Options of every task.

    Attributes:
        name: What problems and messages call it.
        type: One of the table, or `their_package.module:Class`.
        weight: As a cost, how much its square counts.
        required: As a cost, whether there is no success without it.
        tolerance_m: How far off it may be to count as met [m].
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
    """Turns errors of unknown names and wrong values into a `KeyedError` of an option, or of keys inside of it."""
    try:
        yield
    except KeyedError as error:
        raise KeyedError(f"{key}.{error.key}", error.message) from None
    except (UnknownNameError, ValueError) as error:
        raise KeyedError(key, str(error)) from None


class Linearization(NamedTuple):
    """k numbers that a task wants between bounds, for one configuration.

    Attributes:
        values: k numbers [m or rad].
        jacobian: How they change with what is free, k x m.
        lower: k lower bounds, -inf where there is none.
        upper: k upper bounds, inf where there is none; where all are like the lower ones, the same array.
    """

    values: np.ndarray
    jacobian: np.ndarray
    lower: np.ndarray
    upper: np.ndarray

    @property
    def is_exact(self) -> bool:
        """Whether it wants values, and no ranges."""
        return self.lower is self.upper

    def beyond(self) -> np.ndarray:
        """Returns how far the k numbers are outside their bounds."""
        if self.is_exact:
            return self.values - self.lower
        return self.values - np.minimum(np.maximum(self.values, self.lower), self.upper)


class Task(ABC):
    """Something that a configuration shall fulfil: a cost to keep low, or a constraint to hold.

    The options of a subclass are its `Config`, in YAML. One thread at a time calls `begin`, and then `rows` for each
    configuration that is tried.

    Args:
        config: Its options.
        robot: The robot; in `rows`, it is in the configuration.

    Raises:
        KeyedError: If an option does not fit the robot; it names the key.
    """

    Config: ClassVar[type[TaskConfig]] = TaskConfig

    def __init__(self, config: TaskConfig, robot: PinocchioRobot) -> None:
        self.config = config
        self.robot = robot

    def begin(self, problem: IKProblem, goal: Sequence[float] | None, q: np.ndarray) -> None:
        """Takes what a problem says of the task.

        Args:
            problem: The problem.
            goal: What it wants of this task; None: what the formulation says.
            q: The configuration where the search starts.

        Raises:
            ValueError: If the goal makes no sense, or there is none.
            KeyedError: If another field of the problem does not fit; it names the field.
        """
        if goal is not None:
            raise ValueError("this task has no goal")

    @abstractmethod
    def rows(self, q: np.ndarray) -> Linearization:
        """Returns what it wants, for one configuration."""

    def residual(self, beyond: np.ndarray) -> Residual:
        """Returns how far off it is when its k numbers are so far off their bounds [m or rad]; here all are lengths."""
        return Residual(math.hypot(*beyond.tolist()), 0.0)

    def size(self, residual: Residual) -> float:
        """Returns how far off it is in tolerances: up to 1, it is met."""
        return max(residual.position_m / self.config.tolerance_m, residual.orientation_rad / self.config.tolerance_rad)
