"""A user's own task for the solver `tasks`: keeps an axis of a link upright."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from custom_ros_tools.schema import Text
from ik_ros.tasks.robot import PinocchioRobot
from ik_ros.tasks.task import Linearization, Task, TaskConfig


class LevelConfig(TaskConfig):
    """Options: the link."""

    frame: Text


class Level(Task):
    """Keeps the z axis of a link upright."""

    Config = LevelConfig

    def __init__(self, config: LevelConfig, robot: PinocchioRobot) -> None:
        super().__init__(config, robot)
        self._link_id = robot.link_id(config.frame)

    def rows(self, q: np.ndarray) -> Linearization:
        up = self.robot.frame(self._link_id).rotation
        jacobian = -up @ pin.skew(np.array((0.0, 0.0, 1.0))) @ self.robot.jacobian(self._link_id)[3:]
        wanted = np.zeros(2)
        return Linearization(up[:2, 2], jacobian[:2], wanted, wanted)
