"""The search for a solution: from one start after the other, until one leads to the target."""

import math
import time
from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np
import pybullet

from .chain import Chain, Target
from .limits import TURN, Limits
from .methods import BREAK_S, DampedLeastSquares, SelectivelyDampedLeastSquares, Step, go_near, towards_posture
from .problem import PybulletProblem
from .residual import POSITION_TOLERANCE_M, Residual

RANDOM_STARTS = 50
"""How many random starts follow those that the problem names."""
RANDOM_STARTS_BEYOND_REACH = 5
"""How many, if the arm stretched out could not be long enough: only the best of what there is can be found."""
ITERATIONS_A_STAGE = 20
"""After so many iterations, positions are brought into limits and the way that was gained is looked at."""
ITERATIONS_A_START = 120
"""Most iterations from one start, unless the problem says otherwise."""
JOINT_ITERATIONS = 14_000
"""Most iterations for one problem, times the number of joints: 2,000 for 7 joints, some 20 ms."""
THRESHOLD = 0.1
"""Residual at which the search stops, unless the problem says otherwise, see `Residual.size`."""
SEED = 0
"""Of the random starts."""
MUCH_NEARER = 0.8
"""Out of reach, the robot leaves the posture that it has for one that is off the target by so much less, as a part."""
LEAST_WEIGHT = 1e-3
"""Least damping and least range of a joint, as a part of the largest."""


class Search:
    """One search.

    Args:
        chain: The link to move, and the m joints that do.
        target: Where it shall be.
        limits: Limits of the m joints.
        problem: What else is asked for; it fits the robot.
        current: m positions where the robot is [rad or m].
    """

    def __init__(
        self, chain: Chain, target: Target, limits: Limits, problem: PybulletProblem, current: Sequence[float]
    ) -> None:
        self._chain, self._target, self._limits, self._problem = chain, target, limits, problem
        self._current, _ = limits.wrap_to_limits(current, current)
        self._rest = self._of_chain(problem.resetPoses)
        self._threshold = min(problem.residualThreshold / POSITION_TOLERANCE_M, 1.0) or THRESHOLD
        damping = _damping(self._of_chain(problem.jointDamping), len(current))
        solver = chain, target, 0.5 * self._threshold * POSITION_TOLERANCE_M, damping
        self._fast_step: Step = DampedLeastSquares(*solver)
        is_selective = problem.solver == pybullet.IK_SDLS
        self._asked_step = SelectivelyDampedLeastSquares(*solver) if is_selective else self._fast_step
        self._iterations_left = JOINT_ITERATIONS // max(1, len(current))

    def run(self) -> tuple[np.ndarray, Residual]:
        """Returns the best m positions [rad or m] that were found, and how far off the target they are.

        Those of a target out of reach are as near to it as the robot comes downhill from where it is, so that a target
        that moves on does not throw the robot from one posture to another; unless another one is much nearer.
        """
        q, residual = self._solution()
        if residual.size > 1.0 and self._current:
            return self._nearest(q)
        if len(self._rest):
            ranges = self._of_chain(self._problem.jointRanges)
            ranges = np.where(ranges > 0.0, ranges, TURN)  # PyBullet's -1 of joints without limits
            weights = np.maximum(ranges / ranges.max(), LEAST_WEIGHT)
            most = max(residual.size, self._threshold)
            q = towards_posture(self._chain, self._target, self._limits, self._rest, weights, q, most)
            residual = self._chain.residual(self._target, q)
        return q, residual

    def _solution(self) -> tuple[np.ndarray, Residual]:
        """Returns the best positions from the first start that leads to the target, else the best of all."""
        best = np.array(self._current)
        least = self._chain.residual(self._target, best)
        for step, start in self._starts():
            for q, residual in self._descent(step, np.array(start)):
                if residual.size < least.size:
                    best, least = q, residual
                if least.size <= self._threshold:
                    break
            if least.size <= 1.0:
                break
        return best, least

    def _nearest(self, best: np.ndarray) -> tuple[np.ndarray, Residual]:
        task = self._chain, self._target, self._limits
        steps = self._problem.maxNumIterations or ITERATIONS_A_START
        q, off = go_near(*task, np.array(self._current), steps)
        other, other_off = go_near(*task, best, steps)
        if other_off < MUCH_NEARER * off:
            q = other
        return q, self._chain.residual(self._target, q)

    def _starts(self) -> Iterator[tuple[Step, list[float]]]:
        """Yields where to start: at the rest posture, where the robot is, and then at random, with the faster step."""
        if not self._current:
            return
        if len(self._rest):
            yield self._asked_step, self._limits.wrap_to_limits(self._rest.tolist(), self._current)[0]
        is_reachable = self._chain.reach.covers(self._target.position)
        restarts = RANDOM_STARTS if is_reachable else RANDOM_STARTS_BEYOND_REACH
        for i, start in enumerate(self._limits.starts(self._current, restarts, partial(np.random.default_rng, SEED))):
            yield (self._fast_step if i else self._asked_step), start

    def _descent(self, step: Step, q: np.ndarray) -> Iterator[tuple[np.ndarray, Residual]]:
        """Goes from a start towards the target, and yields each stage on the way.

        A joint that ran into a limit is left there for one stage, so that the others make up for it.
        """
        last = math.inf
        frozen = stuck = np.equal(self._limits.lower, self._limits.upper)
        for_this_start = self._problem.maxNumIterations or ITERATIONS_A_START
        while (iterations := min(ITERATIONS_A_STAGE, for_this_start, self._iterations_left)) > 0:
            for_this_start -= iterations
            self._iterations_left -= iterations
            moved = step(q, frozen, iterations)
            if not np.isfinite(moved).all():
                return
            inside, stopped = self._limits.wrap_to_limits(moved.tolist(), self._current)
            q = np.array(inside)
            residual = self._chain.residual(self._target, q)
            yield q, residual
            time.sleep(BREAK_S)
            if residual.size > 0.5 * last and not any(stopped):
                return
            frozen, last = stuck | stopped, residual.size

    def _of_chain(self, values: Sequence[float]) -> np.ndarray:
        """Returns what a field of the problem has for the joints of the chain, if it has anything."""
        return np.array(values, dtype=float)[self._chain.members] if len(values) else np.empty(0)


def _damping(given: np.ndarray, count: int) -> np.ndarray:
    """Returns how unwilling each joint is to move; the most willing one has 1."""
    if not given.any():
        return np.ones(count)
    given = np.maximum(given, LEAST_WEIGHT * given.max())
    return given / given.min()
