"""Problems that follow each other."""

from __future__ import annotations

import dataclasses
import time

import numpy as np

from .joint_rate_limiter import JointRateLimiter
from .problem import IKProblem, IKSolution, JointPositions
from .solver import Solver

LONGEST_PERIOD_S = 0.1
"""A target that comes after a longer pause goes on as if it had been this long."""


class ProblemStream:
    """Solves problems one after the other, each from where the last one led.

    Args:
        solver: What solves them.
        continuity: Keeps the joints within their velocities; without it, targets are the solutions.
    """

    def __init__(self, solver: Solver, continuity: JointRateLimiter | None = None) -> None:
        self._solver = solver
        self._continuity = continuity
        self._last: JointPositions = {}
        self._last_s: float | None = None

    def solve(self, problem: IKProblem, stamp_s: float = 0.0) -> IKSolution:
        """Solves the next problem.

        Args:
            problem: With its poses in the solver's base. Joints that its `start` leaves out start where the last target
                was; with continuity, that all of them do, and the first start has to be complete.
            stamp_s: When it was posed [s]; 0 is now.

        Returns:
            The solution, with positions on the way to it as far as continuity allows. A trajectory is left as it is.

        Raises:
            UnknownNameError: If it names a joint that is not there.
            ValueError: If it makes no sense.
        """
        is_first = not self._last
        start: JointPositions = {**self._last, **problem.start}
        if self._continuity is not None:
            start = self._complete(problem.start) if is_first else self._last
        solution = self._solver.solve(dataclasses.replace(problem, start=start))
        if not solution.success:
            return solution
        if self._continuity is not None and solution.trajectory is None:
            if is_first and start:
                positions = [start[name] for name in self._solver.joint_names]
                self._continuity.begin(np.clip(positions, self._solver.lower, self._solver.upper).tolist())
            target, share = self._continuity.next(solution.positions, self._period_s(stamp_s))
            message = solution.message
            if share < 1.0:
                message = f"{message}; the joints are {share:.0%} of the way there"
            solution = dataclasses.replace(solution, positions=tuple(target.tolist()), message=message)
        self._last = dict(zip(self._solver.joint_names, solution.positions))
        return solution

    def _complete(self, start: JointPositions) -> JointPositions:
        """Returns a start, which must have all joints or none: the robot would jump to what is made up for the rest."""
        missing = [name for name in self._solver.joint_names if name not in start]
        if start and missing:
            raise ValueError(f"start: continuity begins there and needs all joints; it lacks {', '.join(missing)}")
        return start

    def _period_s(self, stamp_s: float) -> float:
        """Returns the time since the last problem [s]."""
        now_s = stamp_s or time.monotonic()
        period_s = 0.0 if self._last_s is None else now_s - self._last_s
        self._last_s = now_s
        return min(max(period_s, 0.0), LONGEST_PERIOD_S)
