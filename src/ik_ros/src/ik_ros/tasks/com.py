"""Where the centre of mass is."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from custom_ros_tools.schema import ListOf, Position
from ik_ros.formulation.robot import Robot
from ik_ros.formulation.task import Linearization, Task, TaskConfig
from ik_ros.problem import IKProblem


class ComConfig(TaskConfig):
    """Options of this task.

    Attributes:
        goal: Where it shall be, x, y, z in the base [m]; None: each problem says.
        axes: Which axes of the base count.
    """

    goal: Position | None = None
    axes: ListOf[Literal["x", "y", "z"]] = ("x", "y", "z")


class Com(Task):
    """Brings the centre of mass of the robot to a position."""

    Config = ComConfig

    def __init__(self, config: ComConfig, robot: Robot) -> None:
        super().__init__(config, robot)
        self._used = np.array([axis in config.axes for axis in "xyz"])
        self._default = config.goal
        self._goal = np.zeros(3)

    def begin(self, problem: IKProblem, goal: Sequence[float] | None, q: np.ndarray) -> None:
        position = self._default if goal is None else goal
        if position is None:
            raise ValueError("missing, neither the problem nor the formulation has one")
        if len(position) != 3:
            raise ValueError(f"expected a position (x, y, z), got {list(position)}")
        self._goal = np.array(position)[self._used]

    def rows(self, q: np.ndarray) -> Linearization:
        com, jacobian = self.robot.com(q)
        return Linearization(com[self._used], jacobian[self._used], self._goal, self._goal)
