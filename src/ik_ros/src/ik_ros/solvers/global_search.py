"""The solver `global`: returns several solutions, such as elbow up, elbow down or wrist flipped, the best first."""

import math
from collections.abc import Callable, Sequence
from typing import Annotated, Literal

from pydantic import Field

from custom_ros_tools.schema import Count, Positive
from ik_ros.chain.kdl import Goal
from ik_ros.chain.levenberg_marquardt import levenberg_marquardt
from ik_ros.problem import IKProblem

from .kdl import KdlConfig, KdlSolver


class GlobalConfig(KdlConfig):
    """Options of the solver `global`.

    Attributes:
        restarts: Number of random starts after the given start; a found solution does not end the search. At most 15
            with tolerances or mimic joints, and at most 3 for targets beyond reach. The search ends early if the first
            10 starts miss the target even without joint limits.
        rank_by: Quantity by which solutions are sorted. `distance_to_start` is the Euclidean distance of the joint
            positions from the start. `middle_of_limits` is the largest distance of a joint from the middle of its
            limits, divided by half the joint's range.
        distinct: Two solutions count as distinct if a joint differs by more than this value [rad or m].
        most: Largest number of returned solutions, including the best solution.
    """

    restarts: Count = 100
    rank_by: Literal["distance_to_start", "middle_of_limits"] = "distance_to_start"
    distinct: Positive = 0.5
    most: Annotated[int, Field(ge=1)] = 16


class GlobalSolver(KdlSolver):
    """Runs `kdl` from random starts and returns the distinct solutions.

    Redundant robots have infinitely many solutions. The solver returns some of them that differ by at least `distinct`.
    """

    Config = GlobalConfig

    def __init__(self, config: GlobalConfig) -> None:
        super().__init__(config)
        self._distinct, self._most = config.distinct, config.most
        self._cost: Callable[[Sequence[float], Sequence[float]], float] = {
            "distance_to_start": math.dist,
            "middle_of_limits": self._off_middle,
        }[config.rank_by]

    def find(self, problem: IKProblem, goal: Goal, start: list[float]) -> Sequence[Sequence[float]]:
        """Returns distinct solutions, or the best positions if all searches fail. See `ChainSolver.find`."""
        found = [(self.residual(goal, q).size, q) for q in self.candidates(problem, goal, start, self._restarts)]
        solutions = sorted((self._cost(q, start), q) for size, q in found if size <= 1.0)
        if not solutions:
            return [levenberg_marquardt(self.chain, goal, self.limits, min(found)[1])]
        kept: list[list[float]] = []
        for _, q in solutions:
            differ = (any(abs(a - b) > self._distinct for a, b in zip(q, other)) for other in kept)
            if len(kept) < self._most and all(differ):
                kept.append(q)
        return kept

    def _off_middle(self, q: Sequence[float], start: Sequence[float]) -> float:
        """Returns the largest distance of a joint from the middle of its limits, divided by half the joint's range.

        The value is 1 if a joint is at a limit.
        """
        return max(
            2.0 * abs(position - middle) / (upper - lower) if upper > lower else 0.0
            for position, middle, lower, upper in zip(q, self.limits.middle, self.lower, self.upper)
        )
