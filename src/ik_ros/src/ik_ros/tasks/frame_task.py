"""Base class of the tasks about the pose, position or orientation of a link."""

import math
from collections.abc import Sequence
from typing import ClassVar, Literal

import numpy as np
import pinocchio as pin

from custom_ros_tools.schema import KeyedError, ListOf, Text
from ik_ros.problem import IKProblem
from robot_model.geometry import Pose, normalized
from robot_model.reach import Residual

from .robot import PinocchioRobot, to_se3
from .task import Linearization, Task, TaskConfig, keyed_errors

Axis = Literal["x", "y", "z", "rx", "ry", "rz"]
AXES: tuple[Axis, ...] = ("x", "y", "z", "rx", "ry", "rz")


class FrameTaskConfig(TaskConfig):
    """Options of the tasks `frame_pose`, `frame_position` and `frame_orientation`.

    Attributes:
        frame: Name of the link.
        goal: Pose, position or orientation to reach, in the base frame. None: taken from each problem.
        axes: Axes of the goal frame along or about which the link has to match the goal: `x`, `y`, `z` for translation,
            `rx`, `ry`, `rz` for rotation.
    """

    frame: Text
    goal: ListOf[float] | None = None
    axes: ListOf[Axis] = AXES


class FrameTask(Task):
    """Moves a link to a pose, along and about some or all axes of the goal frame.

    Attributes:
        link_id: Pinocchio's index of the link.
        goal: Target pose of the link in the base frame, a `pinocchio.SE3`.
        is_complete: Whether the options select all six axes.
    """

    Config = FrameTaskConfig
    available: ClassVar[tuple[str, ...]] = AXES
    """Axes that the option `axes` may contain."""
    goal_words: ClassVar[str] = "a pose (x, y, z, qx, qy, qz, qw)"

    def __init__(self, config: FrameTaskConfig, robot: PinocchioRobot) -> None:
        super().__init__(config, robot)
        with keyed_errors("frame"):
            self.link_id = robot.link_id(config.frame)
        axes = config.axes if "axes" in config.model_fields_set else self.available
        if not set(axes) <= set(self.available):
            raise KeyedError("axes", f"expected some of {', '.join(self.available)}, got {', '.join(axes)}")
        self.is_complete = len(set(axes)) == len(AXES)
        self._counts = np.array([axis in axes for axis in AXES])
        with keyed_errors("goal"):
            self._default = None if config.goal is None else self.pose_of(config.goal)
        self._set_goal(self._default or Pose())

    def pose_of(self, values: Sequence[float]) -> Pose:
        """Converts the values of a goal to a pose.

        Raises:
            ValueError: If the number of values is wrong, or the quaternion is 0.
        """
        if len(values) != 7 or math.hypot(*values[3:]) < 1e-6:
            raise ValueError(f"expected {self.goal_words}, got {list(values)}")
        x, y, z, *quaternion = values
        return Pose((x, y, z), normalized(quaternion))

    def begin(self, problem: IKProblem, goal: Sequence[float] | None, q: np.ndarray) -> None:
        pose = self._default if goal is None else self.pose_of(goal)
        if pose is None:
            raise ValueError("missing, neither the problem nor the formulation has one")
        self._set_goal(pose)

    def aim(self, problem: IKProblem) -> None:
        """Sets goal and tolerances to those of a problem; does nothing if the problem has no target."""
        if problem.target is not None:
            self._set_goal(problem.target, (*problem.position_tolerance, *problem.rotation_tolerance))

    def rows(self, q: np.ndarray) -> Linearization:
        """Returns the link's position [m] and rotation vector [rad] in the goal frame, see `Task`.

        Only the components of the selected axes are returned.
        """
        off = self.goal.actInv(self.robot.frame(self.link_id))
        rotation = off.rotation
        jacobian = self.robot.jacobian(self.link_id)
        rows = np.empty_like(jacobian)
        np.matmul(rotation, jacobian[:3], out=rows[:3])
        np.matmul(pin.Jlog3(rotation), jacobian[3:], out=rows[3:])
        values = np.empty(6)
        values[:3], values[3:] = off.translation, pin.log3(rotation)
        if self._all_count:
            return Linearization(values, rows, self._lower, self._upper)
        return Linearization(values[self._used], rows[self._used], self._lower, self._upper)

    def residual(self, beyond: np.ndarray) -> Residual:
        off = beyond.tolist()
        return Residual(math.hypot(*off[: self._lengths]), math.hypot(*off[self._lengths :]))

    def _set_goal(self, pose: Pose, tolerance: Sequence[float] = (0.0,) * 6) -> None:
        self.goal = to_se3(pose)
        wide = np.array(tolerance)
        self._used = self._counts & ~((np.arange(6) >= 3) & (wide >= np.pi))
        self._all_count = bool(self._used.all())
        self._lengths = int(self._used[:3].sum())
        self._upper = wide[self._used]
        self._lower = -self._upper if wide.any() else self._upper
