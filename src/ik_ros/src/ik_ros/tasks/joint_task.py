"""Base class of the tasks about joint positions."""

import math
from collections.abc import Sequence

import numpy as np

from custom_ros_tools.schema import KeyedError
from ik_ros.problem import IKProblem
from robot_model.reach import Residual

from .robot import PinocchioRobot
from .task import Linearization, Task, TaskConfig, keyed_errors


class JointTask(Task):
    """Keeps the positions of k joints within bounds.

    Args:
        config: Options of the task.
        robot: The robot.
        joints: Names of the k joints.
        key: Key of the option that names the joints, for error messages.

    Attributes:
        indices: Indices of the k joints in the robot's `joint_names`.
        bounds: k lower and k upper bounds [rad or m]; initially infinite.
    """

    def __init__(self, config: TaskConfig, robot: PinocchioRobot, joints: Sequence[str], key: str) -> None:
        super().__init__(config, robot)
        with keyed_errors(key):
            self.indices = [robot.index(name) for name in joints]
        self._jacobian = robot.joint_rows(self.indices)
        self.keep_near(None, 0.0)

    def keep_near(self, middle: np.ndarray | None, distance: np.ndarray | float) -> None:
        """Sets the bounds to `middle - distance` and `middle + distance` [rad or m].

        Args:
            middle: k positions; None for infinite bounds.
            distance: k distances, or one distance for all joints.
        """
        if middle is None:
            middle, distance = np.zeros(len(self.indices)), np.inf
        self.bounds = middle - distance, middle + distance

    def bring_to(self, goal: np.ndarray) -> None:
        """Sets lower and upper bounds to the same k positions [rad or m]."""
        self.bounds = goal, goal

    def previous(self, problem: IKProblem, most: int) -> list[np.ndarray]:
        """Returns the k joint positions of a problem's latest previous solutions, the newest last [rad or m].

        Args:
            problem: The problem.
            most: Largest number of solutions to return.

        Raises:
            KeyedError: If a solution lacks a joint; the error names the solution and the joint.
        """
        names = [self.robot.joint_names[i] for i in self.indices]
        solutions = list(enumerate(problem.previous))[-most:]
        for i, solution in solutions:
            for name in names:
                if name not in solution:
                    raise KeyedError(f"previous[{i}]", f"lacks '{name}', which the task '{self.config.name}' needs")
        return [np.array([solution[name] for name in names]) for _, solution in solutions]

    def rows(self, q: np.ndarray) -> Linearization:
        return Linearization(self.robot.positions(q)[self.indices], self._jacobian, *self.bounds)

    def residual(self, beyond: np.ndarray) -> Residual:
        return Residual(0.0, math.hypot(*beyond.tolist()))
