"""Motions that are checked: a command, and the braking from it."""

from functools import cached_property
from typing import NamedTuple

import numpy as np

from robot_model.model import RobotModel

from .braking import Brake, BrakingCommands

WAYPOINT_SPACING = 0.15
"""Largest motion of all joints together between two waypoints [rad or m], unless they move more in one period."""


class State(NamedTuple):
    """Last command to n joints, with its backward differences.

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
        """Returns the state of a robot at rest."""
        return cls(position, np.zeros_like(position), np.zeros_like(position))

    @property
    def is_at_rest(self) -> bool:
        """Whether nothing moves."""
        return not (self.velocity.any() or self.acceleration.any())

    def then(self, position: np.ndarray, period_s: float) -> "State":
        """Returns the state after a further command of n positions [rad or m], a period [s] later."""
        velocity = (position - self.position) / period_s
        return State(position, velocity, (velocity - self.velocity) / period_s)


class Bound(NamedTuple):
    """A bound near one of k configurations: `gradient @ (q - configuration) >= -room`.

    Attributes:
        row: Number of the configuration.
        gradient: n derivatives of the safety distance by the joints.
        room: Remaining distance; negative beyond the bound.
    """

    row: int
    gradient: np.ndarray
    room: float


class CommandedMotion:
    """A command to n joints in row 0, and the braking from it in the rows below: k rows, a period apart.

    Attributes:
        robot: The robot.
        period_s: The period [s].
        start: The state before the command.
        is_trial: Whether only the verdict matters, so any violation may be reported.
        position: k x n [rad or m].
        velocity: k x n [rad/s or m/s].
        acceleration: k x n [rad/s^2 or m/s^2].
        jerk: k x n [rad/s^3 or m/s^3].
    """

    def __init__(
        self,
        robot: RobotModel,
        start: State,
        command: np.ndarray,
        period_s: float,
        brake: Brake | None = None,
        is_trial: bool = False,
    ) -> None:
        self.robot, self.start, self.period_s, self.is_trial = robot, start, period_s, is_trial
        state = start.then(command, period_s)
        jerk = (state.acceleration - start.acceleration) / period_s
        self.position, self.velocity = command[None], state.velocity[None]
        self.acceleration, self.jerk = state.acceleration[None], jerk[None]
        if brake is not None:
            self.position = np.concatenate((self.position, command + brake.displacement))
            self.velocity = np.concatenate((self.velocity, brake.velocity))
            self.acceleration = np.concatenate((self.acceleration, brake.acceleration))
            self.jerk = np.concatenate((self.jerk, brake.jerk))
        self._link_positions: dict[str, np.ndarray] = {}

    @property
    def braking_commands(self) -> BrakingCommands:
        """The braking."""
        return BrakingCommands(self.position[1:], self.velocity[1:], self.acceleration[1:], self.jerk[1:])

    @cached_property
    def with_start(self) -> np.ndarray:
        """The command before, and the k rows: (k + 1) x n positions [rad or m]."""
        return np.concatenate((self.start.position[None], self.position))

    @cached_property
    def travelled(self) -> np.ndarray:
        """Length of the path of each joint from row 0 to each row, k x n [rad or m]."""
        travelled = np.zeros_like(self.position)
        np.cumsum(np.abs(self.position[1:] - self.position[:-1]), axis=0, out=travelled[1:])
        return travelled

    @cached_property
    def waypoints(self) -> np.ndarray:
        """Rows close enough to each other, including the first and the last."""
        travelled = self.travelled.sum(axis=1)
        marks = np.arange(WAYPOINT_SPACING, travelled[-1], WAYPOINT_SPACING)
        rows = np.searchsorted(travelled, marks).tolist()
        return np.array(list(dict.fromkeys((0, *rows, len(travelled) - 1))))

    @cached_property
    def waypoint_frames(self) -> np.ndarray:
        """Frames of links at the waypoints, see `LinkFrames`."""
        return self.robot.frames.at(self.position[self.waypoints])

    @property
    def path(self) -> np.ndarray:
        """Length of the path of each of n joints after row 0 [rad or m]."""
        path: np.ndarray = self.travelled[-1]
        return path

    def link_positions(self, link: str) -> np.ndarray:
        """Returns the positions of a link's origin in the robot's root, at the previous command and the k rows [m]."""
        if link not in self._link_positions:
            self._link_positions[link] = self.robot.frames.positions(self.with_start, link)
        return self._link_positions[link]
