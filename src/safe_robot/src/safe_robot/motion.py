"""What is checked: a command, and the braking from it."""

from functools import cached_property
from typing import NamedTuple

import numpy as np

from .braking import Brake
from .robot import GuardedRobot, LinkPoses


class State(NamedTuple):
    """Where n joints were commanded to last, and how they moved there: backward differences of the commands.

    Attributes:
        position: n [rad or m].
        velocity: n [rad/s or m/s].
        acceleration: n [rad/s^2 or m/s^2].
    """

    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray

    @classmethod
    def at_rest(cls, position: np.ndarray) -> "State":
        """Returns the state of a robot that stands."""
        return cls(position, np.zeros_like(position), np.zeros_like(position))

    @property
    def is_at_rest(self) -> bool:
        """Whether nothing moves."""
        return not (self.velocity.any() or self.acceleration.any())

    def then(self, position: np.ndarray, period_s: float) -> "State":
        """Returns the state after a further command of n positions [rad or m], a period [s] later."""
        velocity = (position - self.position) / period_s
        return State(position, velocity, (velocity - self.velocity) / period_s)


class Motion:
    """A command to n joints in row 0, and the braking from it in the rows below: k rows, a period apart.

    Attributes:
        robot: The robot.
        period_s: The period [s].
        start: The state before the command.
        position: k x n [rad or m].
        velocity: k x n [rad/s or m/s].
        acceleration: k x n [rad/s^2 or m/s^2].
        jerk: k x n [rad/s^3 or m/s^3].
    """

    def __init__(
        self, robot: GuardedRobot, start: State, command: np.ndarray, period_s: float, brake: Brake | None = None
    ) -> None:
        self.robot, self.start, self.period_s = robot, start, period_s
        state = start.then(command, period_s)
        jerk = (state.acceleration - start.acceleration) / period_s
        rows = ((command, state.velocity, state.acceleration, jerk),)
        self.position, self.velocity, self.acceleration, self.jerk = (np.array(row) for row in zip(*rows))
        if brake is not None:
            self.position = np.concatenate((self.position, command + brake.displacement))
            self.velocity = np.concatenate((self.velocity, brake.velocity))
            self.acceleration = np.concatenate((self.acceleration, brake.acceleration))
            self.jerk = np.concatenate((self.jerk, brake.jerk))
        self._poses: dict[str, LinkPoses] = {}

    @cached_property
    def with_start(self) -> np.ndarray:
        """The command before, and the k rows: (k + 1) x n positions [rad or m]."""
        return np.concatenate((self.start.position[None], self.position))

    @cached_property
    def path(self) -> np.ndarray:
        """How far each of n joints moves after row 0, there and back counted [rad or m]."""
        return np.abs(np.diff(self.position, axis=0)).sum(axis=0)

    def poses(self, link: str) -> LinkPoses:
        """Returns where a link is in the robot's root, in the command before and the k rows."""
        if link not in self._poses:
            self._poses.update(self.robot.poses(self.with_start, [link]))
        return self._poses[link]

    def sparse_rows(self, reach: np.ndarray, spacing_m: float) -> np.ndarray:
        """Returns rows of `with_start`, 0 excluded, between which nothing moves further than a spacing.

        Row 1, the command, and the last row are among them; a single period's motion is not divided.

        Args:
            reach: How far n joints move anything, for 1 rad or m each, see `GuardedRobot.reach`.
            spacing_m: The spacing [m].
        """
        travelled = np.cumsum(np.abs(np.diff(self.with_start, axis=0)) @ reach)
        marks = np.arange(travelled[0] + spacing_m, travelled[-1], spacing_m)
        rows = np.searchsorted(travelled, marks, side="right")
        return np.unique(np.concatenate(((1,), rows, (len(self.position),))))
