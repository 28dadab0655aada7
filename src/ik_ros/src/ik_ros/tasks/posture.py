"""The task `posture`: moves joints to given positions."""

from collections.abc import Sequence

import numpy as np
from pydantic import Field

from ik_ros.problem import IKProblem

from .joint_task import JointTask
from .robot import PinocchioRobot
from .task import TaskConfig


class PostureConfig(TaskConfig):
    """Options of the task `posture`.

    Attributes:
        goal: Target position by joint name [rad or m]; joints that are not listed are free.
    """

    goal: dict[str, float] = Field(min_length=1)


class Posture(JointTask):
    """Moves joints to given positions. A problem's goal replaces all positions, in the order of the option `goal`."""

    Config = PostureConfig

    def __init__(self, config: PostureConfig, robot: PinocchioRobot) -> None:
        super().__init__(config, robot, list(config.goal), "goal")
        self._default = np.array(list(config.goal.values()))
        self.bring_to(self._default)

    def begin(self, problem: IKProblem, goal: Sequence[float] | None, q: np.ndarray) -> None:
        if goal is not None and len(goal) != len(self._default):
            raise ValueError(f"expected {len(self._default)} positions, got {len(goal)}")
        self.bring_to(self._default if goal is None else np.array(goal))
