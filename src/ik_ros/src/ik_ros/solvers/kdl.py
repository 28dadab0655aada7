"""The default solver: the Orocos Kinematics and Dynamics Library with restarts, limits and tolerances."""

import math
import random
from collections.abc import Iterator, Sequence
from functools import partial

import PyKDL

from custom_ros_tools.schema import Count
from ik_ros.chain.kdl import Goal
from ik_ros.chain.levenberg_marquardt import levenberg_marquardt
from ik_ros.chain.solver import ChainConfig, ChainSolver
from ik_ros.problem import IKProblem

ITERATIONS = 60
"""Most iterations from one start; if there is a solution, about 20 suffice."""
THRESHOLD = 1e-5
"""Residual at which KDL stops [m]; it counts a radian as 0.01 m."""
RESTARTS_BEYOND_REACH = 3
"""Number of further starts if the target is beyond reach, where only the nearest position can be found."""
GIVE_UP_AFTER = 10
"""Number of starts that miss the target even without limits after which the search ends.

Of 100 starts for a target within reach, 85 reach it with an arm of 6 joints, and at least 96 with one of 7.
"""
MAX_DESCENTS = 15
"""Most random starts of our own descent, which takes ten times longer than KDL and ends within limits half of the
time."""
NEAR_M, NEAR_RAD = 0.3, 0.8
"""Distance from its target below which the tip keeps its posture [m]."""


class KdlConfig(ChainConfig):
    """Options of `kdl`.

    Attributes:
        restarts: Number of random starts after the given one.
    """

    restarts: Count = 50


class KdlSolver(ChainSolver):
    """KDL's Levenberg-Marquardt, extended by limits and tolerances.

    It searches from the start for the nearest solution. If that is outside limits, random starts follow; if the start
    is near the target, our own descent within limits is tried first. With tolerances or mimic joints, only our own
    descent is used.
    """

    Config = KdlConfig
    deterministic = True

    def __init__(self, config: KdlConfig) -> None:
        super().__init__(config)
        self._restarts = config.restarts
        self._kdl = PyKDL.ChainIkSolverPos_LMA(self.chain.kdl, eps=THRESHOLD, maxiter=ITERATIONS)
        self._from = PyKDL.JntArray(len(self.joint_names))
        self._to = PyKDL.JntArray(len(self.joint_names))

    def find(self, problem: IKProblem, goal: Goal, start: list[float]) -> Sequence[Sequence[float]]:
        """Returns the first solution, or else the best positions found; see `ChainSolver`."""
        best, least = start, math.inf
        for q in self.candidates(problem, goal, start, self._restarts):
            size = self.residual(goal, q).size
            if size < least:
                best, least = q, size
            if least <= 1.0:
                break
        return [levenberg_marquardt(self.chain, goal, self.limits, best)]

    def candidates(self, problem: IKProblem, goal: Goal, start: list[float], restarts: int) -> Iterator[list[float]]:
        """Yields the result of each start, within limits: first of the given start, then of random ones [rad or m]."""
        if not (goal.is_point and self.chain.is_plain):
            for first in self._starts(problem, start, min(restarts, MAX_DESCENTS)):
                yield levenberg_marquardt(self.chain, goal, self.limits, first)
            return
        way = self.residual(goal, start)
        is_near = way.position_m < NEAR_M and way.orientation_rad < NEAR_RAD
        has_arrived = False
        for count, first in enumerate(self._starts(problem, start, restarts), 1):
            q, arrived = self._nearest(goal, first, start)
            yield q
            if first is start and is_near:
                yield levenberg_marquardt(self.chain, goal, self.limits, start)
            has_arrived |= arrived
            if count == GIVE_UP_AFTER and not has_arrived:
                return

    def _starts(self, problem: IKProblem, start: list[float], restarts: int) -> Iterator[list[float]]:
        """Yields the given start, and then random ones."""
        most = min(restarts, RESTARTS_BEYOND_REACH) if self.is_beyond_reach(problem) else restarts
        return self.limits.starts(start, most, partial(random.Random, problem.seed))

    def _nearest(self, goal: Goal, first: Sequence[float], near: Sequence[float]) -> tuple[list[float], bool]:
        """Returns KDL's result from `first`, brought into limits, and whether it reached the goal before that."""
        for i, position in enumerate(first):
            self._from[i] = position
        status = self._kdl.CartToJnt(self._from, goal.frame, self._to)
        q = [self._to[i] for i in range(len(first))]
        return self.limits.wrap_to_limits(q if all(map(math.isfinite, q)) else first, near)[0], status == 0
