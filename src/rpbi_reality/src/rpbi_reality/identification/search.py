"""Searches for the parameters: robust least squares where motion is smooth, CMA-ES where contacts make it rough."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import qmc

from custom_ros_tools.errors import InterfaceError, MissingDependency

from .evaluator import Evaluates, Evaluation
from .fit_config import FitConfig, ParameterConfig

DIFFERENCES = (0.1, 0.03, 0.01)
"""Steps of finite differences, as fractions of the bounds: at first, in between, and at the end of a search."""
STARTS = 4
"""Number of values at which a search by least squares begins."""
REACHES = (0.1, 0.04)
"""Standard deviations of random steps along the least determined direction, as fractions of the bounds."""
SOFT = 0.5
"""Residual beyond which the loss of least squares grows linearly, in standard deviations."""
NO_EFFECT = 1e-9
"""Largest change of all errors at which nothing depends on a parameter."""


class ParameterSpace:
    """Maps values of parameters to the unit cube and back.

    Args:
        parameters: The parameters, indexed by name.
    """

    def __init__(self, parameters: Mapping[str, ParameterConfig]) -> None:
        self.names = list(parameters)
        self._each = list(parameters.values())

    def unit(self, values: Mapping[str, float]) -> np.ndarray:
        """Returns the coordinates of values, each 0 to 1 within the bounds, shape (m,)."""
        rows = []
        for name, each in zip(self.names, self._each):
            low, high, value = *each.bounds, values[name]
            if each.scale == "log":
                low, high, value = math.log(low), math.log(high), math.log(value)
            rows.append((value - low) / (high - low))
        return np.array(rows)

    def values(self, unit: np.ndarray) -> dict[str, float]:
        """Returns the values at coordinates, which are first brought within 0 and 1."""
        found = {}
        for name, each, place in zip(self.names, self._each, np.clip(unit, 0.0, 1.0).tolist()):
            low, high = each.bounds
            if each.scale == "log":
                found[name] = math.exp(math.log(low) + place * (math.log(high) - math.log(low)))
            else:
                found[name] = low + place * (high - low)
        return found

    @property
    def first(self) -> np.ndarray:
        """Coordinates of the first values."""
        return self.unit({name: each.first for name, each in zip(self.names, self._each)})

    def prior(self, values: Mapping[str, float]) -> np.ndarray:
        """Returns the distances from the means of the priors, in standard deviations."""
        pairs = [(values[name], each.prior) for name, each in zip(self.names, self._each)]
        return np.array([(value - prior[0]) / prior[1] for value, prior in pairs if prior is not None])


class Found(NamedTuple):
    """Result of a search.

    Attributes:
        unit: Best coordinates, shape (m,).
        points: Coordinates of evaluated candidates near the best, shape (k, m).
        runs: Error of each run for each of these candidates, shape (k, runs).
        residuals: Residuals of each run at the best coordinates; empty for `cmaes`.
        jacobians: Derivatives of these residuals, shape (residuals, m) for each run; empty for `cmaes`.
    """

    unit: np.ndarray
    points: np.ndarray
    runs: np.ndarray
    residuals: list[np.ndarray]
    jacobians: list[np.ndarray]


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
    return (_cmaes if config.method == "cmaes" else _least_squares)(config, space, evaluate, runs, report)


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


def _least_squares(
    config: FitConfig, space: ParameterSpace, evaluate: Evaluates, runs: Sequence[int], report: Callable[[str], None]
) -> Found:
    """Trust region reflective (Branch, Coleman and Li 1999) with the loss soft L1 over all residuals.

    Contacts make the errors jump at some values of a parameter, and a search can end at such a jump. Therefore:

    - Many values, spread over the bounds, are tried in a few runs. Short searches begin at the best of them, each in
      another part of the runs. The search continues from the best of their results.
    - The differences for the derivatives are large at first, so that they reach over jumps, and become smaller
      (implicit filtering, Kelley 2011).
    - From the end, random steps along the directions that the data determine least look for a way on.

    A candidate in a part of the runs counts as that part of an evaluation.
    """
    before, slopes_and_start = evaluate.simulated, 2 * len(space.names) + 1

    def left() -> int:
        """Returns the number of evaluations that are left for the search."""
        return config.evaluations - slopes_and_start - math.ceil((evaluate.simulated - before) / len(runs))

    def sorted_by_cost(units: Sequence[np.ndarray], some: Sequence[int]) -> list[np.ndarray]:
        """Returns coordinates in the order of their losses in some runs."""
        found = evaluate([space.values(x) for x in units], some)
        return [units[i] for i in np.argsort([_robust(each, space, x) for each, x in zip(found, units)])]

    def best_of_parts(begins: Sequence[np.ndarray], budget: int) -> np.ndarray:
        """Searches from each of the begins in another part of the runs; returns the best end, or the first begin."""
        parts, ends = len(begins), [begins[0]]
        for i, begin in enumerate(begins):
            ends.append(_Descent(space, evaluate, runs[i::parts], report, DIFFERENCES[0]).run(begin, budget))
        return sorted_by_cost(ends, runs)[0]

    random, unit = np.random.default_rng(config.seed), space.first
    if left() // 4 >= 2 * slopes_and_start:
        tried = [unit, *qmc.Halton(len(unit), seed=config.seed).random(left() // 4)]
        begins = sorted_by_cost(tried, runs[:: max(1, len(runs) // 4)])[: min(STARTS, len(runs))]
        unit = best_of_parts(begins, left() // 4)
    for searches, difference in zip((5, 4, 3), DIFFERENCES):
        unit = _Descent(space, evaluate, runs, report, difference).run(unit, left() // searches)
    descent = _Descent(space, evaluate, runs, report, DIFFERENCES[-1])
    for reach in REACHES:
        count = left() // 4 - slopes_and_start
        if count >= slopes_and_start:
            descent.rows(unit)
            steps = _least_determined(descent.jacobian(unit, counts_jumps=False), reach)
            tried = [unit, *(np.clip(unit + steps @ random.normal(size=len(unit)), 0.0, 1.0) for _ in range(count))]
            best = sorted_by_cost(tried, runs)[0]
            unit = unit if best is unit else descent.run(best, left() // 2)
    unit = descent.run(unit, left())
    descent.rows(unit)
    descent.jacobian(unit, counts_jumps=False)  # for the uncertainty
    empty = np.zeros((0, len(space.names))), np.zeros((0, len(runs)))
    return Found(unit, *empty, descent.residuals, descent.jacobians)


def _least_determined(jacobian: np.ndarray, reach: float) -> np.ndarray:
    """Returns a matrix that maps normal numbers to steps, which change the errors equally in all directions.

    Args:
        jacobian: Derivatives of the residuals, shape (residuals, m).
        reach: Standard deviation of the steps along the least determined direction; no direction has more.
    """
    _, singular, axes = np.linalg.svd(jacobian, full_matrices=False)
    smallest = max(float(singular[-1]), 1e-12)
    return np.asarray(axes.T * (reach * smallest / np.maximum(singular, smallest)))


def _robust(evaluation: Evaluation, space: ParameterSpace, unit: np.ndarray) -> float:
    """Returns the loss soft L1 of an evaluation, and of the priors."""
    rows = np.concatenate([*evaluation.residuals, space.prior(space.values(unit))])
    return float((np.sqrt(1.0 + (rows / SOFT) ** 2) - 1.0).sum())


class _Descent:
    """One search by least squares, in some of the runs, with one step of finite differences."""

    def __init__(
        self,
        space: ParameterSpace,
        evaluate: Evaluates,
        runs: Sequence[int],
        report: Callable[[str], None],
        difference: float,
    ) -> None:
        self._space, self._evaluate, self._runs, self._report = space, evaluate, runs, report
        self._difference = difference
        self.residuals: list[np.ndarray] = []
        self.jacobians: list[np.ndarray] = []

    def run(self, unit: np.ndarray, evaluations: int) -> np.ndarray:
        """Returns the coordinates with the smallest loss that are found from a start.

        Args:
            unit: The start.
            evaluations: Largest number of candidates.
        """
        steps = evaluations // (2 * len(unit) + 1)
        if steps < 2:  # the first one evaluates the start
            return unit
        solved = least_squares(
            self.rows,
            np.clip(unit, 1e-3, 1.0 - 1e-3),
            self.jacobian,
            (0.0, 1.0),
            loss="soft_l1",
            f_scale=SOFT,
            max_nfev=steps,
            x_scale="jac",
            xtol=1e-6,
            ftol=1e-6,
        )
        return np.array(solved.x)

    def rows(self, unit: np.ndarray) -> np.ndarray:
        """Returns all residuals."""
        evaluation = self._evaluate([self._space.values(unit)], self._runs)[0]
        error = math.sqrt(evaluation.runs.mean())
        self._report(f"{self._evaluate.count} candidates, error {error:.4g} sigma")
        self.residuals = evaluation.residuals
        return np.concatenate([*evaluation.residuals, self._space.prior(self._space.values(unit))])

    def jacobian(self, unit: np.ndarray, counts_jumps: bool = True) -> np.ndarray:
        """Central differences, one-sided at the bounds; see `slopes` for differences that do not count jumps."""
        space, count = self._space, len(unit)
        low = np.maximum(unit - self._difference, 0.0)
        high = np.minimum(unit + self._difference, 1.0)
        steps = [np.where(np.arange(count) == i, side, unit) for i in range(count) for side in (low, high)]
        found = self._evaluate([space.values(each) for each in steps], self._runs)
        columns, priors = [], []
        for i in range(count):
            before, after = found[2 * i], found[2 * i + 1]
            each = zip(before.residuals, self.residuals, after.residuals)
            if counts_jumps:
                columns.append([(b - a) / (high[i] - low[i]) for a, _, b in each])
            else:
                columns.append([slopes(*rows, unit[i] - low[i], high[i] - unit[i]) for rows in each])
            before_prior, after_prior = (space.prior(space.values(steps[2 * i + side])) for side in (0, 1))
            priors.append((after_prior - before_prior) / (high[i] - low[i]))
        self.jacobians = [np.stack([column[run] for column in columns], 1) for run in range(len(self._runs))]
        return np.vstack([*self.jacobians, np.stack(priors, 1)])


def slopes(before: np.ndarray, here: np.ndarray, after: np.ndarray, back: float, ahead: float) -> np.ndarray:
    """Returns the derivatives of residuals that contacts make jump at some values of a parameter.

    The derivative is the central difference. Where the differences to both sides disagree by half, there is a jump on
    one side, and the smaller difference is the derivative: a jump would count as sensitivity, and the intervals would
    be too narrow.

    Args:
        before: Residuals at a smaller value, shape (n,).
        here: Residuals at the value, shape (n,).
        after: Residuals at a larger value, shape (n,).
        back: Distance to the smaller value; 0 at a bound.
        ahead: Distance to the larger value; 0 at a bound.
    """
    if not back or not ahead:
        return (after - before) / (back + ahead)
    left, right = (here - before) / back, (after - here) / ahead
    smaller = np.where(abs(left) < abs(right), left, right)
    agree = abs(left - right) <= 0.5 * np.maximum(abs(left), abs(right))
    return np.where(agree, (after - before) / (back + ahead), smaller)


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
    return Found(centre, np.array(points)[near], table[near], [], [])
