"""The command nearest to a desired one that satisfies bounds of checks: a quadratic program, solved by DAQP."""

from collections.abc import Sequence
from importlib.util import find_spec

import numpy as np

from safe_robot.braking import Braking
from safe_robot.motion import Bound, State

MOMENTS = 5
"""Number of instants during braking at which bounds are kept."""
TINY = 1e-12
"""A bound that changes by less than this within the range of commands is ignored [m]."""


def can_keep_bounds() -> bool:
    """Returns whether the solver of quadratic programs is installed: DAQP, of the extra `ik`."""
    return find_spec("daqp") is not None


class StoppingTrajectory:
    """Positions of n joints at some instants of braking after a command, linearised about the command.

    Args:
        command: n positions [rad or m].
        state: The state before it.
        period_s: The period [s].

    Attributes:
        slope: Derivative of the positions at each instant by the command, MOMENTS x n; the first instant is the
            command, the last is rest.
    """

    def __init__(self, command: np.ndarray, state: State, braking: Braking, period_s: float) -> None:
        after = state.then(command, period_s)
        by_velocity, by_acceleration = braking.factors(after.velocity, after.acceleration, MOMENTS)
        still = state.then(state.position, period_s)
        self.slope = 1.0 + by_velocity / period_s + by_acceleration / period_s**2
        self._offset = state.position + by_velocity * still.velocity + by_acceleration * still.acceleration
        self._start = state.position

    def of(self, command: np.ndarray) -> np.ndarray:
        """Returns the positions after a command, MOMENTS x n."""
        return self._offset + self.slope * (command - self._start)


class CommandQP:
    """The command nearest to a desired one, between two others, that satisfies bounds until the robot rests.

    Bounds are linearised constraints. If a command turns out to be unsafe, bounds that are linearised there are added,
    and the next command is better.

    Args:
        wanted: n positions [rad or m].
        other: n positions, at the other end of the range of commands.
    """

    def __init__(self, wanted: np.ndarray, other: np.ndarray) -> None:
        self._wanted = wanted
        self._least, self._most = np.minimum(wanted, other), np.maximum(wanted, other)
        self._rows: list[np.ndarray] = []
        self._rooms: list[float] = []

    def add(self, bounds: Sequence[Bound], at: np.ndarray, stop: StoppingTrajectory) -> None:
        """Adds bounds that hold near k x n positions, at the last k instants of braking."""
        slope, way = stop.slope[-len(at) :], stop.of(self._wanted)[-len(at) :] - at
        for row, gradient, room in bounds:
            self._rows.append(gradient * slope[row])
            self._rooms.append(room + float(gradient @ way[row]))

    def command(self) -> np.ndarray | None:
        """Returns the command, n positions; None if there is none."""
        import daqp  # of the extra `ik`

        wanted, n = self._wanted, len(self._wanted)
        if not self._rows:
            return wanted
        scale = np.maximum(self._most - self._least, 1e-9)  # of joints, so that the program has ordinary numbers
        rows = np.array(self._rows) * scale
        sizes = np.maximum(np.linalg.norm(rows, axis=1), TINY)  # of bounds, since the solver's tolerance is absolute
        matrix = np.ascontiguousarray(rows / sizes[:, None])
        upper = np.concatenate(((self._most - wanted) / scale, np.full(len(matrix), 1e30)))
        lower = np.concatenate(((self._least - wanted) / scale, -np.array(self._rooms) / sizes))
        scaled, _, flag, _ = daqp.solve(np.diag(scale * scale) / scale.max() ** 2, np.zeros(n), matrix, upper, lower)
        found = wanted + scale * scaled
        return np.clip(found, self._least, self._most) if flag > 0 and np.isfinite(found).all() else None
