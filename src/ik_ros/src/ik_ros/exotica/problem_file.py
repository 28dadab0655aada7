"""Reads EXOTica's XML files, which contain a problem and its solver."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, NamedTuple, TypeVar

from pydantic import Field

from custom_ros_tools.errors import ConfigError, Problem, UnknownNameError

from .elements import CostConfig, ElementConfig, Numbers, SceneConfig, SolverConfig, element_of, list_of
from .maps import MAPS, TaskMap
from .records import XmlRecord, read_records

SOLVER = "IKSolver"
Element = TypeVar("Element", bound=ElementConfig)


class UnconstrainedEndPoseProblem(ElementConfig):
    """A problem that minimises costs of one robot configuration.

    The field `W` weights joints in the steps of EXOTica's own solver, and has no effect here.
    """

    IGNORED = frozenset(("Debug", "StartTime", "DerivativeOrder", "W", "NominalState"))
    PlanningScene: Annotated[
        tuple[SceneConfig, ...],
        list_of(lambda: {"Scene": SceneConfig}, "planning scene"),
        Field(min_length=1, max_length=1),
    ]
    Maps: Annotated[tuple[TaskMap, ...], list_of(lambda: MAPS, "task map that this solver can express")] = ()
    Cost: Annotated[tuple[CostConfig, ...], list_of(lambda: {"Task": CostConfig}, "cost"), Field(min_length=1)]
    StartState: Numbers = ()


class BoundedEndPoseProblem(UnconstrainedEndPoseProblem):
    """An `UnconstrainedEndPoseProblem` with joint bounds, in addition to the URDF's joint limits."""

    IGNORED = frozenset(("Debug", "StartTime", "DerivativeOrder", "W"))
    LowerBound: Numbers = ()
    UpperBound: Numbers = ()


PROBLEMS: dict[str, type[UnconstrainedEndPoseProblem]] = {
    each.__name__: each for each in (UnconstrainedEndPoseProblem, BoundedEndPoseProblem)
}


class ProblemFile(NamedTuple):
    """Content of an XML file.

    Attributes:
        problem: The first problem in the file.
        solver: The first solver in the file; None for a file without solver.
    """

    problem: UnconstrainedEndPoseProblem
    solver: SolverConfig | None


def read_problem(path: str) -> ProblemFile:
    """Reads the first problem and the first solver in a file, as EXOTica does.

    Raises:
        ConfigError: If the file cannot be read, or contains an element that the solver `tasks` cannot express. The
            message names the file and the element.
    """
    records = read_records(path)
    solvers = [record for record in records if record.kind.endswith("Solver")]
    problems = [record for record in records if record.kind.endswith("Problem")]
    if not problems:
        raise ConfigError([Problem(path, "", f"expected a problem: {' or '.join(PROBLEMS)}")])
    return ProblemFile(
        _parsed(path, PROBLEMS, problems[0], "problem that this solver can express"),
        _parsed(path, {SOLVER: SolverConfig}, solvers[0], "solver of EXOTica that can be expressed")
        if solvers
        else None,
    )


def _parsed(path: str, models: Mapping[str, type[Element]], record: XmlRecord, kind: str) -> Element:
    if record.kind not in models:
        raise ConfigError([Problem(path, "", str(UnknownNameError(kind, record.kind, models)))])
    try:
        return element_of(models[record.kind], record, path)
    except ConfigError as error:
        problems = [Problem(path, f"{record.kind}.{each.key}".rstrip("."), each.message) for each in error.problems]
        raise ConfigError(problems) from None
