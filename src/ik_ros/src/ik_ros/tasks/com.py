"""The task `com`: moves the robot's centre of mass to a position."""

from collections.abc import Sequence
from typing import Literal

import numpy as np

from custom_ros_tools.schema import ListOf, Position
from ik_ros.problem import IKProblem

from .robot import PinocchioRobot
from .task import Linearization, Task, TaskConfig


class ComConfig(TaskConfig):
    """Options of the task `com`.

    Attributes:
        goal: Target position x, y, z of the centre of mass in the base frame [m]. None: taken from each problem.
        axes: Axes of the base frame along which the position has to match.
    """

    goal: Position | None = None
    axes: ListOf[Literal["x", "y", "z"]] = ("x", "y", "z")


class Com(Task):
    """Moves the robot's centre of mass to a position."""

    Config = ComConfig

    def __init__(self, config: ComConfig, robot: PinocchioRobot) -> None:
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
