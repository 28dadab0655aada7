"""The solver `trac_ik`: TRAC-IK runs two methods in parallel, and takes the first result (Beeson and Ames 2015)."""

import math
import random
from collections.abc import Sequence
from functools import partial
from typing import Annotated, Literal

from pydantic import Field

from custom_ros_tools.errors import ConfigError, MissingDependency, Problem
from custom_ros_tools.schema import Count, Positive, Unit
from ik_ros.chain.kdl import Goal
from ik_ros.chain.solver import ChainConfig, ChainSolver, large_tolerances, refuse_mimics
from ik_ros.problem import IKProblem

from .kdl import KdlConfig, KdlSolver

try:
    import pytracik
except ImportError:
    raise MissingDependency("pytracik", "./rpbi setup") from None


_ENDS = set(ChainConfig.model_fields)


class TracIkConfig(ChainConfig):
    """Options of the solver `trac_ik`.

    Attributes:
        timeout: Longest search from one start [s]. Solve types other than `Speed` always use the whole time.
        epsilon: Largest error of a solution [m and rad].
        solve_type: Criterion of the returned solution. `Speed`: found first. `Distance`: nearest to the start.
            `Manip1`: largest product of the Jacobian's singular values. `Manip2`: best ratio of the Jacobian's singular
            values.
        restarts: Number of random starts after the given start. Each start has its own timeout.
    """

    timeout: Annotated[float, Field(gt=0, le=60), Unit("s")] = 0.005
    epsilon: Positive = 1e-5
    solve_type: Literal["Speed", "Distance", "Manip1", "Manip2"] = "Speed"
    restarts: Count = 3


class TracIkSolver(ChainSolver):
    """Uses the TRAC-IK library from the package `pytracik`.

    Problems with Cartesian tolerances, which `pytracik` does not support, are solved by the solver `kdl`. Solutions are
    not deterministic, since they depend on the timing of two threads.

    Raises:
        ConfigError: If the chain has a mimic joint, or a prismatic joint without limits; the error names the joint.
    """

    Config = TracIkConfig
    deterministic = False

    def __init__(self, config: TracIkConfig) -> None:
        super().__init__(config)
        refuse_mimics(config, "trac_ik")
        for joint in self.description.joints:
            if joint.type == "prismatic" and math.isinf(joint.upper):
                message = f"joint '{joint.name}' slides without limits, which 'trac_ik' cannot solve for; 'kdl' can"
                raise ConfigError([Problem(config.urdf_filename, "", message)])
        self._restarts = config.restarts
        self._with_tolerances = KdlSolver(KdlConfig.model_construct(**config.model_dump(include=_ENDS)))
        solve_type = getattr(pytracik.SolveType, config.solve_type)
        ends = self.description.base, self.description.tip
        self._trac_ik = pytracik.TRAC_IK(*ends, self.description.urdf, config.timeout, config.epsilon, solve_type)

    def find(self, problem: IKProblem, goal: Goal, start: list[float]) -> Sequence[Sequence[float]]:
        """Returns the first solution, or an empty list if TRAC-IK does not find a solution. See `ChainSolver.find`."""
        if large_tolerances(problem):
            return self._with_tolerances.find(problem, goal, start)
        target = (*goal.frame.p, *goal.frame.M.GetQuaternion())
        restarts = 0 if self.is_beyond_reach(problem) else self._restarts
        for first in self.limits.starts(start, restarts, partial(random.Random, problem.seed)):
            status, *q = pytracik.ik(self._trac_ik, first, *target).tolist()
            if status >= 0:
                return [q]
        return []
