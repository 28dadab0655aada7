"""The search for a safe command near to a target that is not safe."""

from collections.abc import Callable, Iterator, Sequence
from typing import TypeVar

import numpy as np

from safe_robot.braking import Braking
from safe_robot.check import Check, Violation
from safe_robot.limits import MotionLimits
from safe_robot.motion import Bound, State

from .command_qp import CommandQP, StoppingTrajectory, can_keep_bounds
from .pursuit import pursue

Safe = TypeVar("Safe")

SHARES = (0.5, 0.2)
"""Shares of the step from braking to the desired command that are tried."""
DETOURS = 3
"""Number of times that violated bounds are added and another command is tried."""
OVER, OVER_M = 0.5, 1e-8
"""Tightening of a violated bound: a share of the violation, and a constant."""


class SafeCommandSearch:
    """Finds safe commands to n joints near a target.

    Args:
        limits: Limits of the joints.
        braking: Their braking.
        checks: Checks of commands, which also report obstacles in the way.
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
        """Returns the first safe command among those near the desired one; None if there is none.

        The check that refused the last candidate is asked first, since it likely refuses again.

        Args:
            target: n positions.
            state: Present state of the robot.
            stop: The commands of the braking from there that was found safe, k x n, k >= 1.
            judged: Evaluates n positions by checks in a given order.
        """
        for command in self._commands(target, state, stop):
            found = judged(command, sorted(self._checks, key=lambda check: check.name != self._suspect))
            if not isinstance(found, Violation):
                return found
            self._suspect = found.check
        return None

    def _commands(self, target: np.ndarray, state: State, stop: np.ndarray) -> Iterator[np.ndarray]:
        """Yields candidate commands, the best first; each one after the last was not safe."""
        best, slowest = pursue(target, state, self._limits, self._braking, self._period_s, stop)
        for wanted in self._detours(best, slowest, state, stop) if self._keeps_bounds else [best]:
            best = wanted
            yield best
        for share in SHARES:
            yield stop[0] + share * (best - stop[0])

    def _detours(self, wanted: np.ndarray, slowest: np.ndarray, state: State, stop: np.ndarray) -> Iterator[np.ndarray]:
        """Yields the command nearest to the desired one that satisfies the bounds, then improved ones."""
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
        """Adds the bounds that are violated during braking after a command; returns whether there are any."""
        stop = StoppingTrajectory(command, state, self._braking, self._period_s)
        at = stop.of(command)
        missed = [bound for bound in self._bounds(at, np.zeros_like(command), state) if bound.room < 0.0]
        detour.add([Bound(row, way, (1.0 + OVER) * room - OVER_M) for row, way, room in missed], at, stop)
        return bool(missed)

    def _bounds(self, rows: np.ndarray, spread: np.ndarray, state: State) -> list[Bound]:
        found = [bound for check in self._checks for bound in check.bounds(rows, spread, state.position)]
        return sorted(found, key=lambda bound: bound.row)
