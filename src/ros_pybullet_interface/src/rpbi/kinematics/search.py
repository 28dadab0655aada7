"""Search for a solution of inverse kinematics from several starts, one after another."""

import math
import time
from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np
import pybullet

from robot_model.limits import TURN, Limits
from robot_model.reach import POSITION_TOLERANCE_M, Residual

from .chain import BulletChain, Target
from .methods import BREAK_S, DampedLeastSquares, SelectivelyDampedLeastSquares, Step, go_near, towards_posture
from .problem import PybulletProblem

RANDOM_STARTS = 50
"""Number of random starts after the starts that the problem gives."""
RANDOM_STARTS_BEYOND_REACH = 5
"""Number of random starts for a target out of reach, where only the nearest posture can be found."""
ITERATIONS_A_STAGE = 20
"""Number of iterations after which positions are brought within limits and progress is checked."""
ITERATIONS_A_START = 120
"""Largest number of iterations from one start, unless the problem sets another number."""
JOINT_ITERATIONS = 14_000
"""Largest number of iterations for one problem, times the number of joints: 2,000 for 7 joints, some 20 ms."""
THRESHOLD = 0.1
"""Residual at which the search stops, see `Residual.size`, unless the problem sets another one."""
SEED = 0
"""Seed of the random starts."""
MUCH_NEARER = 0.8
"""For a target out of reach: ratio of errors below which another posture replaces the one near the present posture."""
FAR = 1.0
"""Motion of a joint [rad or m] from which a solution may be in another branch, such as elbow up and elbow down."""
STARTS_NEARBY = 16
"""Number of starts near the present positions, or the rest posture, from which a nearer solution is searched."""
SPREAD = 0.4
"""Standard deviation [rad or m] of the nearby starts."""
LEAST_WEIGHT = 1e-3
"""Smallest damping and smallest range of a joint, as a share of the largest."""


class Search:
    """Searches for positions of a chain's m joints that solve one problem.

    Args:
        chain: Chain of the m joints that move the link.
        target: Target of the link.
        limits: Limits of the m joints.
        problem: The problem, already checked for the robot.
        current: m present positions [rad or m].
    """

    def __init__(
        self, chain: BulletChain, target: Target, limits: Limits, problem: PybulletProblem, current: Sequence[float]
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
        """Searches, and returns the best m positions [rad or m] found and their residual.

        For a target out of reach, the positions minimize the error locally, near the present posture. A moving target
        therefore does not cause jumps between postures. Another posture is returned only if its error is much smaller.
        """
        q, residual = self._solution()
        if residual.size > 1.0 and self._current:
            return self._nearest(q)
        q, residual = self._in_branch(q, residual)
        if len(self._rest):
            ranges = self._of_chain(self._problem.jointRanges)
            ranges = np.where(ranges > 0.0, ranges, TURN)  # PyBullet has -1 for joints without limits
            weights = np.maximum(ranges / ranges.max(), LEAST_WEIGHT)
            most = max(residual.size, self._threshold)
            q = towards_posture(self._chain, self._target, self._limits, self._rest, weights, q, most)
            residual = self._chain.residual(self._target, q)
        return q, residual

    def _in_branch(self, q: np.ndarray, residual: Residual) -> tuple[np.ndarray, Residual]:
        """Searches for a solution nearer to the rest posture, or to the present positions if there is no posture.

        A distant solution may be in another branch, such as elbow up and elbow down. Further searches therefore start
        near the posture or the present positions. The random numbers are the same at each call.

        Returns:
            The nearest solution found, and its residual.
        """
        present = np.array(self._current)
        near = self._rest if len(self._rest) else present
        random, most = np.random.default_rng(SEED), max(residual.size, self._threshold)
        distance = np.abs(q - near).max(initial=0.0)
        for _ in range(STARTS_NEARBY):
            if distance <= FAR:
                break
            start = (near + random.normal(0.0, SPREAD, len(q))).tolist()
            inside, _ = self._limits.wrap_to_limits(start, self._current)
            for candidate, candidate_residual in self._descent(self._fast_step, np.array(inside)):
                if candidate_residual.size <= most:
                    if (candidate_distance := np.abs(candidate - near).max(initial=0.0)) < distance:
                        q, residual, distance = candidate, candidate_residual, candidate_distance
                    break
        return q, residual

    def _solution(self) -> tuple[np.ndarray, Residual]:
        """Searches from one start after another until a solution is found.

        Returns:
            The best positions [rad or m] found so far, and their residual.
        """
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
        """Yields a method and start positions: first the rest posture, then the present positions, then random ones."""
        if not self._current:
            return
        if len(self._rest):
            yield self._asked_step, self._limits.wrap_to_limits(self._rest.tolist(), self._current)[0]
        is_reachable = self._chain.reach.covers(self._target.position)
        restarts = RANDOM_STARTS if is_reachable else RANDOM_STARTS_BEYOND_REACH
        for i, start in enumerate(self._limits.starts(self._current, restarts, partial(np.random.default_rng, SEED))):
            yield (self._fast_step if i else self._asked_step), start

    def _descent(self, step: Step, q: np.ndarray) -> Iterator[tuple[np.ndarray, Residual]]:
        """Moves from a start towards the target, and yields positions and residual after each stage of iterations.

        A joint that reaches a limit is held there for one stage, so that the other joints compensate.
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
        """Returns the m values of the chain's joints from one of the problem's lists; an empty list stays empty."""
        return np.array(values, dtype=float)[self._chain.members] if len(values) else np.empty(0)


def _damping(given: np.ndarray, count: int) -> np.ndarray:
    """Returns the damping of each joint relative to the smallest damping.

    Args:
        given: The problem's `jointDamping` of the m joints; empty or zeros for equal damping.
        count: Number of joints.
    """
    if not given.any():
        return np.ones(count)
    given = np.maximum(given, LEAST_WEIGHT * given.max())
    return given / given.min()
