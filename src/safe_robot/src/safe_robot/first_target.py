"""Where a robot starts from: the first target has to be near, and safe to go to."""

import math
from collections.abc import Sequence

import numpy as np

from custom_ros_tools.errors import ConfigError, Problem

from .check import Check, Situation, Violation
from .config import GuardConfig
from .motion import Motion, State
from .robot import MOST_OUTSIDE, GuardedRobot

SLOW_S = 1e6
"""How long the way from where the robot is to the first target is taken to last [s]: it is not judged by speed."""

UNKNOWN = (
    "no measured positions of all guarded joints on joint_states/measured; publish them there, or, where nothing"
    " measures the robot, set start_from to target"
)


class FirstTarget:
    """Judges the first target after a start.

    Args:
        config: What to guard and how.
        robot: The robot.
        checks: The checks that are made.
        file: Where the configuration comes from, for messages.

    Raises:
        ConfigError: If how far links reach hangs on limits that are not checked.
    """

    def __init__(self, config: GuardConfig, robot: GuardedRobot, checks: Sequence[Check], file: str) -> None:
        if robot.telescopic and not any(check.name == "joint_position" for check in checks):
            message = f"expected true, since joint '{robot.telescopic[0]}' slides in what others turn, got false"
            raise ConfigError([Problem(file, "checks.joint_position.active", message)])
        self._config, self._robot, self._checks = config, robot, checks

    def judged(self, target: np.ndarray, last: np.ndarray | None, situation: Situation) -> State | Violation:
        """Returns the state in which the robot starts, at rest; else why it cannot.

        Args:
            target: n positions [rad or m].
            last: The n positions that were commanded last [rad or m]; None if none were.
            situation: What else counts.
        """
        there = self._whereabouts(target, last, situation)
        if there is None:
            return Violation("start", "measured positions", math.inf, 0.0, "s", words=UNKNOWN)
        violation = self._far_from(there, target) or self._far_outside(there)
        if violation is not None:
            return violation
        slow = Motion(self._robot, State.at_rest(there), target, SLOW_S)
        for check in self._checks:
            if violation := check.check(slow, situation):
                return violation
        if self._config.shape is None:
            return State.at_rest(target)
        if last is None or (np.abs(last - there) > self._config.start_tolerance).any():
            return State.at_rest(there)
        return State.at_rest(last)

    def _whereabouts(self, target: np.ndarray, last: np.ndarray | None, situation: Situation) -> np.ndarray | None:
        names = self._robot.joint_names
        if all(name in situation.measured for name in names):
            return np.array([situation.measured[name] for name in names])
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
        """Returns which joint is so far outside its limits that it is not known how far links reach."""
        for name in self._robot.telescopic:
            i = self._robot.joint_names.index(name)
            joint, position = self._robot.joints[i], float(there[i])
            outside = max(joint.lower - position, position - joint.upper)
            if not outside <= MOST_OUTSIDE:
                return Violation(
                    "start",
                    f"joint '{name}'",
                    outside,
                    MOST_OUTSIDE,
                    self._unit(i),
                    quantity="distance beyond its limits",
                )
        return None
