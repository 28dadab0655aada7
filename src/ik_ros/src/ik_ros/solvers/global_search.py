"""Several solutions instead of one: elbow up, elbow down, the wrist flipped; the best first."""

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
    """Options of `global`.

    Attributes:
        restarts: Number of random starts after the given one, also when a solution is found. Fewer where starts are
            slow or useless: 15 with tolerances or mimic joints, 3 beyond reach. The search also ends after 10 starts
            that miss the target even without limits.
        rank_by: Order of solutions: `distance_to_start`, the distance of all joints from the start [rad or m, root of
            the sum of squares]; or `middle_of_limits`, how far the joint that is nearest to a limit is from the middle,
            as a part of half its range.
        distinct: Two solutions are distinct if a joint differs by more than this [rad or m].
        most: Largest number of returned solutions, including the best one.
    """

    restarts: Count = 100
    rank_by: Literal["distance_to_start", "middle_of_limits"] = "distance_to_start"
    distinct: Positive = 0.5
    most: Annotated[int, Field(ge=1)] = 16


class GlobalSolver(KdlSolver):
    """Runs `kdl` from random starts and returns the distinct solutions.

    Redundant robots have a continuum of solutions, of which it returns `distinct` samples.
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
        """Returns distinct solutions, or else the best positions found; see `ChainSolver`."""
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
        """Returns how far the joint nearest to a limit is from the middle of its limits, 1 at a limit."""
        return max(
            2.0 * abs(position - middle) / (upper - lower) if upper > lower else 0.0
            for position, middle, lower, upper in zip(q, self.limits.middle, self.lower, self.upper)
        )
