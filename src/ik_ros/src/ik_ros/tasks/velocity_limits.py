"""The task `velocity_limits`: limits joint velocities between successive solutions."""

from collections.abc import Sequence

import numpy as np
from pydantic import Field

from custom_ros_tools.schema import Positive, Seconds
from ik_ros.problem import IKProblem

from .joint_task import JointTask
from .robot import PinocchioRobot
from .task import TaskConfig


class VelocityLimitsConfig(TaskConfig):
    """Options of the task `velocity_limits`.

    Attributes:
        dt_s: Time between two successive solutions [s].
        limits: Largest speed by joint name [rad/s or m/s]; joints that are not listed are free. By default, the URDF's
            speed limits apply to all joints.
        factor: Factor by which all speed limits are multiplied.
    """

    dt_s: Seconds
    limits: dict[str, Positive] = Field(default_factory=dict)
    factor: Positive = 1.0
    tolerance_rad: Positive = 1e-6


class VelocityLimits(JointTask):
    """Keeps joint velocities within limits, relative to the previous solution.

    Without a previous solution, the task has no effect.
    """

    Config = VelocityLimitsConfig

    def __init__(self, config: VelocityLimitsConfig, robot: PinocchioRobot) -> None:
        super().__init__(config, robot, list(config.limits) or robot.joint_names, "limits")
        speeds = np.array(list(config.limits.values())) if config.limits else robot.max_velocity
        self._way = speeds * config.factor * config.dt_s

    def begin(self, problem: IKProblem, goal: Sequence[float] | None, q: np.ndarray) -> None:
        super().begin(problem, goal, q)
        last = self.previous(problem, 1)
        self.keep_near(last[0] if last else None, self._way)
