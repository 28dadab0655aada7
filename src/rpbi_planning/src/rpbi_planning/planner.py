"""Interface of planners, which search for a path of proven straight parts."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from custom_ros_tools.schema import ConfigModel

from .collision import CollisionModel
from .constraints import BoundConstraint
from .group import Group

Array = np.ndarray


class PlannerConfig(ConfigModel):
    """Options that all planners have in common."""


@dataclass
class PlanningProblem:
    """A search for a path.

    Attributes:
        model: Checks configurations, and proves motions.
        start: The start, n positions [rad or m].
        goals: Configurations that reach the goal, g x n, the nearest first.
        until: Time of `time.monotonic` at which the search ends [s].
        seed: Seed of random numbers.
        is_cancelled: Function that says whether the search has to end.
        constraints: Constraints that the whole path has to keep; the model checks them, too.
        kept: Data that planners keep for later problems in the same scene, by planner.
    """

    model: CollisionModel
    start: Array
    goals: Array
    until: float
    seed: int = 0
    is_cancelled: Callable[[], bool] = lambda: False
    constraints: Sequence[BoundConstraint] = ()
    kept: dict[str, Any] = field(default_factory=dict)

    @property
    def group(self) -> Group:
        """The joints that move."""
        return self.model.group

    @property
    def is_over(self) -> bool:
        """Whether the search has to end."""
        return time.monotonic() >= self.until or self.is_cancelled()

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Finite limits of the joints; joints without limits turn at most twice around from the start."""
        low, high = self.group.lower, self.group.upper
        turn = 4.0 * np.pi
        return np.where(np.isfinite(low), low, self.start - turn), np.where(np.isfinite(high), high, self.start + turn)


class Planner(ABC):
    """Searches for paths.

    Attributes:
        Config: Options of the planner.
        keeps_constraints: Whether the planner searches among configurations that keep path constraints.
        improves: Whether the planner uses the whole time to make the path shorter.
    """

    Config: ClassVar[type[PlannerConfig]] = PlannerConfig
    keeps_constraints: ClassVar[bool] = False
    improves: ClassVar[bool] = False

    def __init__(self, config: Any) -> None:
        self.config = config

    @abstractmethod
    def search(self, problem: PlanningProblem) -> Array | None:
        """Returns waypoints from the start to one of the goals, m x n, or None.

        All straight motions between waypoints are proven by `problem.model.edge`.
        """


def length(path: Array) -> float:
    """Returns the length of a path in joint space [rad or m]."""
    return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())
