"""The task `look_at`: turns an axis of a link towards a point."""

import math
from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from custom_ros_tools.schema import KeyedError, Position, Text, Vec3
from ik_ros.problem import IKProblem
from robot_model.reach import Residual

from .robot import PinocchioRobot
from .task import Linearization, Task, TaskConfig, keyed_errors

NEAREST_M = 1e-6
"""Distance from the link to the goal below which the direction is undefined [m]."""
ZERO = np.zeros(2)


class LookAtConfig(TaskConfig):
    """Options of the task `look_at`.

    Attributes:
        frame: Name of the link.
        axis: Vector in the link's frame that has to point at the goal; the length may have any value but 0.
        goal: Position x, y, z of the point in the base frame [m]. None: taken from each problem.
    """

    frame: Text
    axis: Vec3 = (0.0, 0.0, 1.0)
    goal: Position | None = None


class LookAt(Task):
    """Turns an axis through a link's origin, such as the optical axis of a camera, towards a point."""

    Config = LookAtConfig

    def __init__(self, config: LookAtConfig, robot: PinocchioRobot) -> None:
        super().__init__(config, robot)
        with keyed_errors("frame"):
            self._link_id = robot.link_id(config.frame)
        length = math.hypot(*config.axis)
        if length < 1e-6:
            raise KeyedError("axis", "must not be zero")
        self._axis = np.array(config.axis) / length
        across = np.eye(3)[np.argmin(np.abs(self._axis))]
        first = np.cross(self._axis, across)
        first /= np.linalg.norm(first)
        self._across = np.stack((first, np.cross(self._axis, first)))
        self._default = config.goal
        self._goal = np.zeros(3)

    def begin(self, problem: IKProblem, goal: Sequence[float] | None, q: np.ndarray) -> None:
        point = self._default if goal is None else goal
        if point is None:
            raise ValueError("missing, neither the problem nor the formulation has one")
        if len(point) != 3:
            raise ValueError(f"expected a point (x, y, z), got {list(point)}")
        self._goal = np.array(point)

    def rows(self, q: np.ndarray) -> Linearization:
        """Returns the angle from the axis to the point, as rotations about two perpendicular axes [rad]; see `Task`."""
        point = self.robot.frame(self._link_id).actInv(self._goal)  # in the link's frame
        jacobian = self.robot.jacobian(self._link_id)
        change = pin.skew(point) @ jacobian[3:] - jacobian[:3]
        across, ahead = self._across @ point, float(self._axis @ point)
        distance2 = float(point @ point)
        if distance2 < NEAREST_M**2:
            return Linearization(ZERO, np.zeros((2, jacobian.shape[1])), ZERO, ZERO)
        aside = float(np.linalg.norm(across))
        if aside < 1e-9:
            across, aside = np.array((1e-9, 0.0)), 1e-9
        angle = math.atan2(aside, ahead)
        # v = (angle / aside) across, with angle = atan2(aside, ahead)
        ratio = angle / aside
        by_aside = (ahead / distance2 - ratio) / aside
        by_ahead = -1.0 / distance2
        change_across = self._across @ change
        change_aside = across @ change_across / aside
        change_ratio = by_aside * change_aside + by_ahead * (self._axis @ change)
        rows = ratio * change_across + np.outer(across, change_ratio)
        return Linearization(ratio * across, rows, ZERO, ZERO)

    def residual(self, beyond: np.ndarray) -> Residual:
        return Residual(0.0, math.hypot(*beyond.tolist()))
