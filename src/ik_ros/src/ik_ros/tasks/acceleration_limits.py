"""The task `acceleration_limits`: limits joint accelerations between successive solutions."""

from collections.abc import Sequence

import numpy as np
from pydantic import Field

from custom_ros_tools.schema import Positive, Seconds
from ik_ros.problem import IKProblem

from .joint_task import JointTask
from .robot import PinocchioRobot
from .task import TaskConfig


class AccelerationLimitsConfig(TaskConfig):
    """Options of the task `acceleration_limits`.

    Attributes:
        dt_s: Time between two successive solutions [s].
        limits: Largest acceleration by joint name [rad/s^2 or m/s^2].
    """

    dt_s: Seconds
    limits: dict[str, Positive] = Field(min_length=1)
    tolerance_rad: Positive = 1e-6


class AccelerationLimits(JointTask):
    """Keeps joint accelerations within limits, relative to the last two solutions.

    With only one previous solution, the joints start at rest. Without a previous solution, the task has no effect.
    """

    Config = AccelerationLimitsConfig

    def __init__(self, config: AccelerationLimitsConfig, robot: PinocchioRobot) -> None:
        super().__init__(config, robot, list(config.limits), "limits")
        self._way = np.array(list(config.limits.values())) * config.dt_s**2

    def begin(self, problem: IKProblem, goal: Sequence[float] | None, q: np.ndarray) -> None:
        super().begin(problem, goal, q)
        known = self.previous(problem, 2)
        self.keep_near(2.0 * known[-1] - known[0] if known else None, self._way)
