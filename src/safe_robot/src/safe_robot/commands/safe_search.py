"""Search for a safe command near an unsafe target.

The safety checks provide linear bounds on positions. The QP solver DAQP finds the command that satisfies these bounds
and is nearest to the target. The extra `ik` installs DAQP. Without DAQP, the search only tries commands on a line
from the next braking command towards the target.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from importlib.util import find_spec
from typing import TypeVar

import numpy as np

from safe_robot.braking import Braking
from safe_robot.check import Check, Violation
from safe_robot.limits import MotionLimits
from safe_robot.motion import Bound, State

from .pursuit import pursue

Safe = TypeVar("Safe")

SHARES = (0.5, 0.2)
"""Interpolation factors of the commands that are tried between braking, 0, and the desired command, 1."""
DETOURS = 3
"""Largest number of times that violated bounds are added to the quadratic program to compute another command."""
OVER, OVER_M = 0.5, 1e-8
"""Tightening of a violated bound: a share of the violation, plus a constant [m]."""
MOMENTS = 5
"""Number of instants during braking at which bounds are enforced."""
TINY = 1e-12
"""Smallest divisor with which the row of a bound is normalised [m]; prevents a division by 0."""


class SafeCommandSearch:
    """Finds safe commands to n joints near a target.

    Args:
        limits: Limits of the joints.
        braking: Computes the braking of the joints.
        checks: Checks that commands have to pass, and that provide the linear bounds.
        period_s: Time between two commands [s].
    """

    def __init__(self, limits: MotionLimits, braking: Braking, checks: Sequence[Check], period_s: float) -> None:
        self._limits, self._braking, self._checks, self._period_s = limits, braking, checks, period_s
        self._keeps_bounds = can_keep_bounds()
        self._suspect = ""

    def find(
        self,
        target: np.ndarray,
        state: State,
        stop: np.ndarray,
        judged: Callable[[np.ndarray, Sequence[Check]], Safe | Violation],
    ) -> Safe | None:
        """Tries commands near a target, and returns the first safe one; None if all are unsafe.

        The check that refused the last candidate runs first, since this check is likely to refuse the next one, too.

        Args:
            target: Target positions, shape (n,) [rad or m].
            state: Present state of the robot.
            stop: Commands of a braking from this state that has passed the checks, shape (k, n), k >= 1 [rad or m].
            judged: Runs checks, in the given order, on a command of n positions. Returns the safe command, or a
                violation.
        """
        for command in self._commands(target, state, stop):
            found = judged(command, sorted(self._checks, key=lambda check: check.name != self._suspect))
            if not isinstance(found, Violation):
                return found
            self._suspect = found.check
        return None

    def _commands(self, target: np.ndarray, state: State, stop: np.ndarray) -> Iterator[np.ndarray]:
        """Yields candidate commands in order of preference."""
        best, slowest = pursue(target, state, self._limits, self._braking, self._period_s, stop)
        for wanted in self._detours(best, slowest, state, stop) if self._keeps_bounds else [best]:
            best = wanted
            yield best
        for share in SHARES:
            yield stop[0] + share * (best - stop[0])

    def _detours(self, wanted: np.ndarray, slowest: np.ndarray, state: State, stop: np.ndarray) -> Iterator[np.ndarray]:
        """Yields commands near `wanted` that satisfy the bounds of the checks.

        The first command satisfies the bounds at the end of braking. If this is impossible, only `wanted` is yielded.
        Each further command also satisfies the bounds that the braking after the previous command would violate.
        """
        there, after = stop[-1:], StoppingTrajectory(wanted, state, self._braking, self._period_s)
        spread = np.abs(after.of(wanted)[-1] - there[0])
        end = after.of(slowest)[-1]
        may_rest = (end >= self._limits.lower) & (end <= self._limits.upper)
        detour = CommandQP(wanted, np.where(may_rest, slowest, stop[0]))
        detour.add(self._bounds(there, spread, state), there, after)
        found = detour.command()
        yield wanted if found is None else found
        for _ in range(DETOURS):
            if found is None or not self._add_missed(detour, found, state):
                return
            found = detour.command()
            if found is not None:
                yield found

    def _add_missed(self, detour: CommandQP, command: np.ndarray, state: State) -> bool:
        """Adds the bounds that braking after a command violates to `detour`, and returns whether bounds were added."""
        stop = StoppingTrajectory(command, state, self._braking, self._period_s)
        at = stop.of(command)
        missed = [bound for bound in self._bounds(at, np.zeros_like(command), state) if bound.room < 0.0]
        detour.add([Bound(row, way, (1.0 + OVER) * room - OVER_M) for row, way, room in missed], at, stop)
        return bool(missed)

    def _bounds(self, rows: np.ndarray, spread: np.ndarray, state: State) -> list[Bound]:
        found = [bound for check in self._checks for bound in check.bounds(rows, spread, state.position)]
        return sorted(found, key=lambda bound: bound.row)


def can_keep_bounds() -> bool:
    """Returns whether the QP solver DAQP, from the extra `ik`, is installed."""
    return find_spec("daqp") is not None


class StoppingTrajectory:
    """Predicts positions of n joints at `MOMENTS` instants of braking after a command, linearly in the command.

    Args:
        command: Commanded positions at which the prediction is exact, shape (n,) [rad or m].
        state: State before the command.
        braking: Computes the braking of the joints.
        period_s: Time between two commands [s].

    Attributes:
        slope: Derivative of each joint's position with respect to the joint's command, shape (MOMENTS, n). At the first
            instant, the joints are at the command. At the last instant, the joints rest.
    """

    def __init__(self, command: np.ndarray, state: State, braking: Braking, period_s: float) -> None:
        after = state.then(command, period_s)
        by_velocity, by_acceleration = braking.factors(after.velocity, after.acceleration, MOMENTS)
        still = state.then(state.position, period_s)
        self.slope = 1.0 + by_velocity / period_s + by_acceleration / period_s**2
        self._offset = state.position + by_velocity * still.velocity + by_acceleration * still.acceleration
        self._start = state.position

    def of(self, command: np.ndarray) -> np.ndarray:
        """Returns the predicted positions during braking after a command, shape (MOMENTS, n) [rad or m]."""
        return self._offset + self.slope * (command - self._start)


class CommandQP:
    """Quadratic program for a command that is as near as possible to a desired command and satisfies linear bounds.

    Bounds apply to the command and to the braking after the command. If a solution turns out to be unsafe, the caller
    adds bounds that are linearised at this solution, and solves again.

    Args:
        wanted: Desired positions, at one end of the range of commands, shape (n,) [rad or m].
        other: Positions at the other end of the range, shape (n,) [rad or m].
    """

    def __init__(self, wanted: np.ndarray, other: np.ndarray) -> None:
        self._wanted = wanted
        self._least, self._most = np.minimum(wanted, other), np.maximum(wanted, other)
        self._rows: list[np.ndarray] = []
        self._rooms: list[float] = []

    def add(self, bounds: Sequence[Bound], at: np.ndarray, stop: StoppingTrajectory) -> None:
        """Adds bounds on the positions at the last k of the `MOMENTS` instants of braking.

        Args:
            bounds: Bounds that are linearised at the positions `at`.
            at: Positions at the k instants, shape (k, n) [rad or m].
            stop: Computes the positions at all instants from the command.
        """
        slope, way = stop.slope[-len(at) :], stop.of(self._wanted)[-len(at) :] - at
        for row, gradient, room in bounds:
            self._rows.append(gradient * slope[row])
            self._rooms.append(room + float(gradient @ way[row]))

    def command(self) -> np.ndarray | None:
        """Solves the program. Returns the command, n positions [rad or m]; None if the program has no solution."""
        import daqp  # of the extra `ik`

        wanted, n = self._wanted, len(self._wanted)
        if not self._rows:
            return wanted
        scale = np.maximum(self._most - self._least, 1e-9)  # range of each joint: scaled variables are of order 1
        rows = np.array(self._rows) * scale
        sizes = np.maximum(np.linalg.norm(rows, axis=1), TINY)  # normalises rows: the solver's tolerance is absolute
        matrix = np.ascontiguousarray(rows / sizes[:, None])
        upper = np.concatenate(((self._most - wanted) / scale, np.full(len(matrix), 1e30)))
        lower = np.concatenate(((self._least - wanted) / scale, -np.array(self._rooms) / sizes))
        scaled, _, flag, _ = daqp.solve(np.diag(scale * scale) / scale.max() ** 2, np.zeros(n), matrix, upper, lower)
        found = wanted + scale * scaled
        return np.clip(found, self._least, self._most) if flag > 0 and np.isfinite(found).all() else None
