"""Staying near the previous solution."""

from collections.abc import Sequence

import numpy as np

from ik_ros.formulation.joint_task import JointTask
from ik_ros.formulation.robot import PinocchioRobot
from ik_ros.formulation.task import TaskConfig
from ik_ros.problem import IKProblem


class Closeness(JointTask):
    """Keeps joints near the previous solution of the problem; if it has none, near its start."""

    def __init__(self, config: TaskConfig, robot: PinocchioRobot) -> None:
        super().__init__(config, robot, robot.joint_names, "name")

    def begin(self, problem: IKProblem, goal: Sequence[float] | None, q: np.ndarray) -> None:
        super().begin(problem, goal, q)
        last = self.previous(problem, 1)
        self.bring_to(last[0] if last else self.robot.positions(q))
