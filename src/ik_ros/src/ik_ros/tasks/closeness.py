"""The task `closeness`: keeps joints near the previous solution."""

from collections.abc import Sequence

import numpy as np

from ik_ros.problem import IKProblem

from .joint_task import JointTask
from .robot import PinocchioRobot
from .task import TaskConfig


class Closeness(JointTask):
    """Keeps joints near the problem's previous solution, or near the start if a previous solution is not given."""

    def __init__(self, config: TaskConfig, robot: PinocchioRobot) -> None:
        super().__init__(config, robot, robot.joint_names, "name")

    def begin(self, problem: IKProblem, goal: Sequence[float] | None, q: np.ndarray) -> None:
        super().begin(problem, goal, q)
        last = self.previous(problem, 1)
        self.bring_to(last[0] if last else self.robot.positions(q))
