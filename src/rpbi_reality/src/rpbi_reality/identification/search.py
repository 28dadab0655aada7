"""Searches for the parameters: robust least squares where motion is smooth, CMA-ES where contacts make it rough."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from custom_ros_tools.errors import InterfaceError, MissingDependency

from .evaluator import Evaluates
from .fit_config import FitConfig
from .least_squares import search_by_least_squares
from .parameter_space import Found, ParameterSpace

NO_EFFECT = 1e-9
"""Largest change of all errors at which nothing depends on a parameter."""


def search(
    config: FitConfig, evaluate: Evaluates, runs: Sequence[int], report: Callable[[str], None] = lambda _: None
) -> Found:
    """Searches for the parameters with the smallest errors.

    Args:
        config: Parameters and method.
        evaluate: Evaluates candidates.
        runs: Indices of the runs from which parameters are identified.
        report: Function that shows a line of progress.

    Raises:
        InterfaceError: If nothing depends on a parameter, or no candidate can be simulated.
        MissingDependency: If `cmaes` is not installed.
    """
    space = ParameterSpace(config.parameters)
    _refuse_without_effect(config, space, evaluate, runs)
    return (_cmaes if config.method == "cmaes" else search_by_least_squares)(config, space, evaluate, runs, report)


def _refuse_without_effect(config: FitConfig, space: ParameterSpace, evaluate: Evaluates, runs: Sequence[int]) -> None:
    """Raises an error that names parameters on which the errors do not depend."""
    first, few = np.clip(space.first, 0.02, 0.98), runs[: min(len(runs), 10)]
    shifted = [first + 0.25 * np.eye(len(first))[i] * (1.0 if first[i] < 0.6 else -1.0) for i in range(len(first))]
    base, *others = evaluate([space.values(each) for each in (first, *shifted)], few)
    if base.problems and len(base.problems) >= len(few):
        raise InterfaceError(f"the world cannot be simulated with the first values: {base.problems[0]}")
    idle = [n for n, each in zip(space.names, others) if abs(each.runs - base.runs).max() <= NO_EFFECT]
    if idle:
        raise InterfaceError(f"nothing measured depends on {', '.join(idle)}; remove it, or add a signal")


def _cmaes(
    config: FitConfig, space: ParameterSpace, evaluate: Evaluates, runs: Sequence[int], report: Callable[[str], None]
) -> Found:
    """Covariance matrix adaptation evolution strategy (Hansen 2016), of the library `cmaes`."""
    try:
        from cmaes import CMA
    except ModuleNotFoundError:
        raise MissingDependency("cmaes", "./rpbi setup identify") from None
    count = len(space.names)
    bounds = np.array([[0.0, 1.0]] * count)
    strategy = CMA(np.clip(space.first, 0.02, 0.98), config.step, bounds=bounds, seed=config.seed)
    points: list[np.ndarray] = []
    errors: list[np.ndarray] = []
    best, means = math.inf, []
    while evaluate.count + strategy.population_size <= config.evaluations and not strategy.should_stop():
        asked = [strategy.ask() for _ in range(strategy.population_size)]
        found = evaluate([space.values(each) for each in asked], runs)
        costs = [each.runs.mean() + (space.prior(space.values(x)) ** 2).sum() for x, each in zip(asked, found)]
        strategy.tell(list(zip(asked, costs)))
        points += asked
        errors += [each.runs for each in found]
        means.append(strategy.mean.copy())
        best = min(best, *costs)
        report(f"{evaluate.count} candidates, error {best:.4g}")
    if not math.isfinite(best) or best >= 1e3:
        problems = "; ".join(list(evaluate.problems)[:1]) or "all simulations diverged"
        raise InterfaceError(f"no candidate could be simulated: {problems}")
    centre = np.mean(means[-5:], 0)
    table = np.array(errors)
    near = np.argsort(table.mean(1))[: max(4 * count * (count + 3) // 2, len(table) // 2)]
    return Found(centre, np.array(points)[near], table[near], [], [], np.zeros((0, count)))
