"""A user's own solver that has problems name further solvers, as `module:Class`."""

from __future__ import annotations

from ik_ros.problem import IKProblem, IKSolution
from ik_ros.solvers import SOLVERS
from ik_ros.solvers.kdl import KdlSolver


class AskedSolver(KdlSolver):
    """Looks up what the goals of a problem are called, and solves it itself."""

    def solve(self, problem: IKProblem) -> IKSolution:
        for name in problem.goals:
            SOLVERS.configured(name)
        return super().solve(problem)
