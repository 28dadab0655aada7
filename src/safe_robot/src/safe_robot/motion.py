"""Motions that are checked: a command, and the braking that would follow the command."""

from functools import cached_property
from typing import NamedTuple

import numpy as np

from robot_model.model import RobotModel

from .braking import Brake, BrakingCommands

WAYPOINT_SPACING = 0.15
"""Approximate path length between two waypoints, summed over all joints [rad or m]."""


class State(NamedTuple):
    """Commanded positions of n joints, with velocities and accelerations as backward differences.

    Attributes:
        position: Positions, shape (n,) [rad or m].
        velocity: Velocities, shape (n,) [rad/s or m/s].
        acceleration: Accelerations, shape (n,) [rad/s^2 or m/s^2].
    """

    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray

    @classmethod
    def at_rest(cls, position: np.ndarray) -> "State":
        """Returns the state of a robot at rest at n positions [rad or m]."""
        return cls(position, np.zeros_like(position), np.zeros_like(position))

    @property
    def is_at_rest(self) -> bool:
        """Whether all velocities and accelerations are 0."""
        return not (self.velocity.any() or self.acceleration.any())

    def then(self, position: np.ndarray, period_s: float) -> "State":
        """Returns the state after n positions [rad or m] are commanded one period [s] later."""
        velocity = (position - self.position) / period_s
        return State(position, velocity, (velocity - self.velocity) / period_s)


class Bound(NamedTuple):
    """A linear bound on positions q near one of k configurations: `gradient @ (q - configuration) >= -room`.

    Attributes:
        row: Index of the configuration.
        gradient: Derivatives of a safety distance with respect to the joint positions, shape (n,) [m/rad or 1].
        room: Distance from the configuration to the bound [m]; negative beyond the bound.
    """

    row: int
    gradient: np.ndarray
    room: float


class CommandedMotion:
    """A command to n joints, and the braking that would follow the command.

    Arrays have k rows, a period apart. Row 0 is the command, and the other rows are the braking.

    Attributes:
        robot: The guarded robot.
        period_s: Time between two rows [s].
        start: The state before the command.
        is_trial: Whether the caller only needs to know if the motion is safe. Checks may then report any violation
            instead of the first violation.
        position: Positions, shape (k, n) [rad or m].
        velocity: Velocities, shape (k, n) [rad/s or m/s].
        acceleration: Accelerations, shape (k, n) [rad/s^2 or m/s^2].
        jerk: Jerks, shape (k, n) [rad/s^3 or m/s^3].
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
        """The braking: all rows except row 0."""
        return BrakingCommands(self.position[1:], self.velocity[1:], self.acceleration[1:], self.jerk[1:])

    @cached_property
    def with_start(self) -> np.ndarray:
        """Positions of the previous command and of the k rows, shape (k + 1, n) [rad or m]."""
        return np.concatenate((self.start.position[None], self.position))

    @cached_property
    def travelled(self) -> np.ndarray:
        """Path length of each joint from row 0 to each row, shape (k, n) [rad or m]."""
        travelled = np.zeros_like(self.position)
        np.cumsum(np.abs(self.position[1:] - self.position[:-1]), axis=0, out=travelled[1:])
        return travelled

    @cached_property
    def waypoints(self) -> np.ndarray:
        """Indices of selected rows, including the first and the last row.

        Between successive selected rows, the path lengths of all joints add up to about `WAYPOINT_SPACING` [rad or m].
        """
        travelled = self.travelled.sum(axis=1)
        marks = np.arange(WAYPOINT_SPACING, travelled[-1], WAYPOINT_SPACING)
        rows = np.searchsorted(travelled, marks).tolist()
        return np.array(list(dict.fromkeys((0, *rows, len(travelled) - 1))))

    @cached_property
    def waypoint_frames(self) -> np.ndarray:
        """Frames of the robot's links at the waypoints; see `LinkFrames.at`."""
        return self.robot.frames.at(self.position[self.waypoints])

    @property
    def path(self) -> np.ndarray:
        """Path length of each joint from row 0 to the last row, shape (n,) [rad or m]."""
        path: np.ndarray = self.travelled[-1]
        return path

    def link_positions(self, link: str) -> np.ndarray:
        """Returns the positions of a link's origin in the frame of the robot's root link, shape (k + 1, 3) [m].

        The first position belongs to the previous command, the others to the k rows.
        """
        if link not in self._link_positions:
            self._link_positions[link] = self.robot.frames.positions(self.with_start, link)
        return self._link_positions[link]
