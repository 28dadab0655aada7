"""Check of the first target after `Guard.start`: the target has to be safe and near the robot."""

import math
from collections.abc import Sequence

import numpy as np

from custom_ros_tools.errors import ConfigError, Problem
from robot_model.model import MAX_OUTSIDE, RobotModel
from safe_robot.check import Check, CheckContext, Violation
from safe_robot.config import GuardConfig
from safe_robot.motion import CommandedMotion, State

SLOW_S = 1e6
"""Assumed duration of the motion to the first target [s]; long enough that its speed is never a violation."""

UNKNOWN = (
    "no measured positions of all guarded joints on joint_states/measured; publish them there, or, where nothing"
    " measures the robot, set start_from to target"
)


class FirstTarget:
    """Checks the first target after `Guard.start`.

    Args:
        config: Configuration of the guard.
        robot: The robot.
        checks: The checks in use.
        file: Source of the configuration, for messages.

    Raises:
        ConfigError: If `RobotModel.reach` depends on joint limits, but the check `joint_position` is not active.
    """

    def __init__(self, config: GuardConfig, robot: RobotModel, checks: Sequence[Check], file: str) -> None:
        if robot.telescopic and not any(check.name == "joint_position" for check in checks):
            message = f"expected true, since joint '{robot.telescopic[0]}' moves links that others turn, got false"
            raise ConfigError([Problem(file, "checks.joint_position.active", message)])
        self._config, self._robot, self._checks = config, robot, checks

    def judged(self, target: np.ndarray, last: np.ndarray | None, context: CheckContext) -> State | Violation:
        """Returns the guard's initial state, in which the robot rests, or the violation that forbids the start.

        Args:
            target: The first target, n positions [rad or m].
            last: The n positions of the last command [rad or m]; None before the first command.
            context: Context of the checks, with the measured positions.
        """
        there = self._present_position(target, last, context)
        if there is None:
            return Violation("start", "measured positions", math.inf, 0.0, "s", words=UNKNOWN)
        violation = self._far_from(there, target) or self._far_outside(there)
        if violation is not None:
            return violation
        slow = CommandedMotion(self._robot, State.at_rest(there), target, SLOW_S)
        for check in self._checks:
            if violation := check.check(slow, context):
                return violation
        if self._config.shape is None:
            return State.at_rest(target)
        if last is None or (np.abs(last - there) > self._config.start_tolerance).any():
            return State.at_rest(there)
        return State.at_rest(last)

    def _present_position(
        self, target: np.ndarray, last: np.ndarray | None, context: CheckContext
    ) -> np.ndarray | None:
        names = self._robot.joint_names
        if all(name in context.measured for name in names):
            return np.array([context.measured[name] for name in names])
        if self._config.start_from == "measured":
            return None
        return target if last is None else last

    def _far_from(self, there: np.ndarray, target: np.ndarray) -> Violation | None:
        distance, tolerance = np.abs(target - there), self._config.start_tolerance
        is_near = distance <= tolerance
        if is_near.all():
            return None
        i = int(np.argmin(is_near))
        subject = f"joint '{self._robot.joint_names[i]}'"
        return Violation(
            "start", subject, float(distance[i]), tolerance, self._unit(i), quantity="distance of the target"
        )

    def _unit(self, i: int) -> str:
        return "rad" if self._robot.joints[i].is_revolute else "m"

    def _far_outside(self, there: np.ndarray) -> Violation | None:
        """Returns a violation if a joint is so far beyond its limits that `RobotModel.reach` is invalid; else None."""
        for name in self._robot.telescopic:
            i = self._robot.joint_names.index(name)
            joint, position = self._robot.joints[i], float(there[i])
            outside = max(joint.lower - position, position - joint.upper)
            if not outside <= MAX_OUTSIDE:
                return Violation(
                    "start",
                    f"joint '{name}'",
                    outside,
                    MAX_OUTSIDE,
                    self._unit(i),
                    quantity="distance beyond its limits",
                )
        return None
