"""Common part of the planners of OMPL, the Open Motion Planning Library (Sucan, Moll and Kavraki, 2012)."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from pydantic import Field

from custom_ros_tools.errors import MissingDependency
from custom_ros_tools.schema import NonNegative
from rpbi_planning.collision import CollisionModel
from rpbi_planning.planner import Array, Planner, PlannerConfig, PlanningProblem

try:
    from ompl import base, geometric, util
except ImportError:
    raise MissingDependency("ompl", "./rpbi setup planning") from None

util.noOutputHandler()


class OmplConfig(PlannerConfig):
    """Options of the planners of OMPL."""

    range: NonNegative = Field(0.0, description="Longest motion that is tried at once [rad or m]; 0: OMPL's choice.")


class _Valid(base.StateValidityChecker):
    def __init__(self, space: Any, model: CollisionModel) -> None:
        super().__init__(space)
        self._model, self._n = model, len(model.group.joint_names)

    def isValid(self, state: Any) -> bool:
        return bool(self._model.is_free(np.array(state[0 : self._n])))


class _Proven(base.MotionValidator):
    def __init__(self, space: Any, model: CollisionModel) -> None:
        super().__init__(space)
        self._model, self._n = model, len(model.group.joint_names)

    def checkMotion(self, start: Any, end: Any, last: Any = None) -> bool:
        q = np.array(end[0 : self._n])
        return bool(self._model.is_free(q) and self._model.edge(np.array(start[0 : self._n]), q))


class OmplPlanner(Planner):
    """Base class of the planners of OMPL.

    Attributes:
        method: Name of the class in `ompl.geometric`.
    """

    Config = OmplConfig
    method: ClassVar[str]

    def search(self, problem: PlanningProblem) -> Array | None:
        """See `Planner`."""
        n = len(problem.start)
        util.RNG.setSeed(problem.seed + 1)
        space, bounds = base.RealVectorStateSpace(n), base.RealVectorBounds(n)
        for i, (low, high) in enumerate(zip(*(each.tolist() for each in problem.bounds))):
            bounds.setLow(i, low)
            bounds.setHigh(i, high)
        space.setBounds(bounds)
        information = base.SpaceInformation(space)
        valid, proven = _Valid(information, problem.model), _Proven(information, problem.model)
        information.setStateValidityChecker(valid)
        information.setMotionValidator(proven)
        information.setup()

        def state(q: Array) -> Any:
            made = information.allocState()
            made[0:n] = q.tolist()
            return made

        definition, goals = base.ProblemDefinition(information), base.GoalStates(information)
        definition.addStartState(state(problem.start))
        for goal in problem.goals:
            goals.addState(state(goal))
        definition.setGoal(goals)
        planner = getattr(geometric, self.method)(information)
        if self.config.range > 0.0 and hasattr(planner, "setRange"):
            planner.setRange(self.config.range)
        planner.setProblemDefinition(definition)
        planner.setup()

        def is_over() -> bool:
            return problem.is_over or (not self.improves and bool(definition.hasExactSolution()))

        planner.solve(base.PlannerTerminationCondition(is_over))
        if not definition.hasExactSolution():
            return None
        return np.array([state[0:n] for state in definition.getSolutionPath().getStates()])
