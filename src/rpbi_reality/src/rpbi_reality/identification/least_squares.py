"""Robust least squares in worlds whose contacts make the errors jump at some values of a parameter."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import qmc

from .evaluator import Evaluates, Evaluation
from .fit_config import FitConfig
from .parameter_space import Found, ParameterSpace

DIFFERENCES = (0.1, 0.03, 0.01)
"""Steps of finite differences, as fractions of the bounds: at first, in between, and at the end of a search."""
STARTS, APART = 16, 0.15
"""Largest number of values at which short searches begin, and their least distance, as a fraction of the bounds."""
FEW = 20
"""One of so many runs is enough for a short search."""
START_STEPS = 5
"""Number of steps of a short search, for each of two differences."""
BEST = 4
"""Number of results of short searches that are compared in all runs."""
LEAST_STEPS = 3
"""Least number of steps of a search in all runs, if evaluations are left."""
REACHES = (0.1, 0.04)
"""Standard deviations of random steps along the least determined direction, as fractions of the bounds."""
PARTS = 5
"""Number of disjoint parts of the runs whose own best values show how far the result depends on the runs."""
PART_STEPS = 4
"""Number of steps of the search in a part."""
SOFT = 0.5
"""Residual beyond which the loss grows linearly, in standard deviations."""


def search_by_least_squares(
    config: FitConfig, space: ParameterSpace, evaluate: Evaluates, runs: Sequence[int], report: Callable[[str], None]
) -> Found:
    """Trust region reflective (Branch, Coleman and Li 1999) with the loss soft L1 over all residuals.

    Contacts make the errors jump, and a search can end at such a jump. Therefore:

    - Many values, spread over the bounds, are tried in a few runs. Short searches begin at the best of them that are
      apart, each in a few other runs. The search continues from the best of their results.
    - The differences for the derivatives are large at first, so that they reach over jumps, and become smaller
      (implicit filtering, Kelley 2011).
    - Random steps from the end, along the directions that the data determine least, look for smaller errors. Each is
      corrected by a Gauss-Newton step.
    - At last, each of several disjoint parts of the runs is searched by itself. The ends show how far the result
      depends on the runs, including on their jumps; if one of them is better in all runs, the search continues there.
    - The last Gauss-Newton step is made only along the directions that lower the loss.

    A candidate in a part of the runs counts as that part of an evaluation.
    """
    before, count = evaluate.simulated, len(space.names)
    slopes_and_start, settling = 2 * count + 1, 3 * count + 4
    parts = min(PARTS, len(runs) // 2) if len(runs) >= 4 else 0
    kept = settling + (PART_STEPS * slopes_and_start + settling + parts + 2 if parts else 0)
    if config.evaluations < 3 * kept:
        parts, kept = 0, settling if config.evaluations > 3 * settling else 0

    def left() -> int:
        """Returns the number of evaluations that are left, without those of the parts and of the end."""
        return config.evaluations - slopes_and_start - kept - math.ceil((evaluate.simulated - before) / len(runs))

    def among(some: Sequence[int]) -> _Runs:
        return _Runs(space, evaluate, some, report)

    def short_searches() -> np.ndarray:
        """Returns the best result of short searches, or the first values if there are too few evaluations."""
        few = max(1, len(runs) // FEW)
        tries, cost = left() * len(runs) // (4 * few), 2 * START_STEPS * slopes_and_start
        if tries < 8 * slopes_and_start:
            return space.first
        tried = among(runs[:few]).sorted_by_loss([space.first, *qmc.Halton(count, seed=config.seed).random(tries)])
        starts = min(STARTS, max(1, left() * len(runs) // (4 * few * cost)))
        ends = []
        for i, end in enumerate(_apart(tried, starts)):
            some = among([runs[(i * few + j) % len(runs)] for j in range(few)])
            for difference in DIFFERENCES[:2]:
                end = some.descend(end, difference, START_STEPS * slopes_and_start)
            ends.append(end)
        return every.sorted_by_loss(among(runs[:few]).sorted_by_loss([tried[0], *ends])[:BEST])[0]

    random, every = np.random.default_rng(config.seed), among(runs)
    unit = short_searches()
    for searches, difference in zip((5, 4, 3), DIFFERENCES):
        unit = every.descend(unit, difference, min(left(), max(left() // searches, LEAST_STEPS * slopes_and_start)))
    for reach in REACHES:
        tries = (left() // 2 - slopes_and_start) // 2
        if tries >= slopes_and_start:
            unit = every.leap(unit, reach, tries, random)
            unit = every.descend(unit, DIFFERENCES[-1], left() // 2)
    unit = every.descend(unit, DIFFERENCES[-1], left())
    ends = []
    for part in (among(runs[i::parts]) for i in range(parts)):
        end = part.descend(unit, DIFFERENCES[1], PART_STEPS * slopes_and_start)
        ends.append(part.settle(end))
    if ends:
        unit = every.sorted_by_loss([unit, *ends, np.mean(ends, 0)])[0]
    if kept:
        unit = every.settle(unit)
    every.rows(unit)
    every.jacobian(unit, DIFFERENCES[-1], counts_jumps=False)  # for the uncertainty
    empty = np.zeros((0, count)), np.zeros((0, len(runs)))
    return Found(unit, *empty, every.residuals, every.jacobians, np.reshape(ends, (-1, count)))


class _Runs:
    """Searches in some of the runs.

    Attributes:
        residuals: Residuals of each run at the last coordinates of `rows`.
        jacobians: Derivatives of these residuals at the last coordinates of `jacobian`, shape (residuals, m).
    """

    def __init__(
        self, space: ParameterSpace, evaluate: Evaluates, runs: Sequence[int], report: Callable[[str], None]
    ) -> None:
        self._space, self._evaluate, self._runs, self._report = space, evaluate, runs, report
        self.residuals: list[np.ndarray] = []
        self.jacobians: list[np.ndarray] = []

    def evaluated(self, units: Sequence[np.ndarray]) -> list[Evaluation]:
        """Returns the errors of candidates."""
        return self._evaluate([self._space.values(unit) for unit in units], self._runs)

    def all_rows(self, unit: np.ndarray, evaluation: Evaluation) -> np.ndarray:
        """Returns all residuals and the distances from the priors."""
        return np.concatenate([*evaluation.residuals, self._space.prior(self._space.values(unit))])

    def losses(self, units: Sequence[np.ndarray]) -> np.ndarray:
        """Returns the losses of candidates."""
        return np.array([loss(self.all_rows(x, each)) for x, each in zip(units, self.evaluated(units))])

    def sorted_by_loss(self, units: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Returns coordinates, the best ones first."""
        return [units[i] for i in np.argsort(self.losses(units), kind="stable")]

    def descend(self, unit: np.ndarray, difference: float, evaluations: int) -> np.ndarray:
        """Returns the coordinates with the smallest loss that a search finds from a start.

        Args:
            unit: The start.
            difference: Step of the finite differences.
            evaluations: Largest number of candidates.
        """
        steps = evaluations // (2 * len(unit) + 1)
        if steps < 2:  # the first one evaluates the start
            return unit
        solved = least_squares(
            self.rows,
            np.clip(unit, 1e-3, 1.0 - 1e-3),
            lambda x: self.jacobian(x, difference),
            (0.0, 1.0),
            loss="soft_l1",
            f_scale=SOFT,
            max_nfev=steps,
            x_scale="jac",
            xtol=1e-6,
            ftol=1e-6,
        )
        return np.array(solved.x)

    def leap(self, unit: np.ndarray, reach: float, tries: int, random: np.random.Generator) -> np.ndarray:
        """Returns the best of random steps, and of these steps after a Gauss-Newton step, or the start.

        Args:
            unit: The start.
            reach: Standard deviation of the steps along the least determined direction.
            tries: Number of random steps.
            random: Draws them.
        """
        start = self.rows(unit)
        jacobian = self.jacobian(unit, DIFFERENCES[-1], counts_jumps=False)
        steps = _least_determined(jacobian, reach)
        tried = [np.clip(unit + steps @ random.normal(size=len(unit)), 0.0, 1.0) for _ in range(tries)]
        rows = [self.all_rows(each, evaluation) for each, evaluation in zip(tried, self.evaluated(tried))]
        corrected = []
        for each, row in zip(tried, rows):
            weighted = jacobian / np.sqrt(1.0 + (row / SOFT) ** 2)[:, None]
            step = np.linalg.lstsq(weighted.T @ jacobian, weighted.T @ row, rcond=1e-9)[0]
            corrected.append(np.clip(each - step, 0.0, 1.0))
        losses = [loss(start), *map(loss, rows), *self.losses(corrected)]
        return [unit, *tried, *corrected][int(np.argmin(losses))]

    def settle(self, unit: np.ndarray) -> np.ndarray:
        """Returns coordinates after a Gauss-Newton step, of which only the parts that lower the loss are made.

        A jump along one direction makes a search refuse the whole step; here, the other directions still improve.

        Args:
            unit: The start.
        """
        rows = self.rows(unit)
        jacobian = self.jacobian(unit, DIFFERENCES[-1], counts_jumps=False)
        weights = (1.0 + (rows / SOFT) ** 2) ** -0.25
        left, singular, axes = np.linalg.svd(jacobian * weights[:, None], full_matrices=False)
        sizes = (left.T @ (rows * weights)) / np.maximum(singular, 1e-12)
        steps = [-size * axis for size, axis in zip(sizes, axes)]
        losses = self.losses([np.clip(unit + step, 0.0, 1.0) for step in steps])
        good = [step for step, each in zip(steps, losses) if each < loss(rows)]
        whole = np.clip(unit + np.sum(good, 0), 0.0, 1.0) if good else unit
        best = np.clip(unit + steps[int(np.argmin(losses))], 0.0, 1.0)
        return self.sorted_by_loss([unit, best, whole])[0]

    def rows(self, unit: np.ndarray) -> np.ndarray:
        """Returns all residuals and the distances from the priors, and keeps the residuals of each run."""
        (evaluation,) = self.evaluated([unit])
        error = math.sqrt(evaluation.runs.mean())
        self._report(f"{self._evaluate.count} candidates, error {error:.4g} sigma")
        self.residuals = evaluation.residuals
        return self.all_rows(unit, evaluation)

    def jacobian(self, unit: np.ndarray, difference: float, counts_jumps: bool = True) -> np.ndarray:
        """Central differences, one-sided at the bounds; see `slopes` for differences that do not count jumps."""
        space, count = self._space, len(unit)
        low = np.maximum(unit - difference, 0.0)
        high = np.minimum(unit + difference, 1.0)
        steps = [np.where(np.arange(count) == i, side, unit) for i in range(count) for side in (low, high)]
        found = self.evaluated(steps)
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


def loss(rows: np.ndarray) -> float:
    """Returns the loss soft L1 of residuals."""
    return float((np.sqrt(1.0 + (rows / SOFT) ** 2) - 1.0).sum())


def _apart(units: Sequence[np.ndarray], most: int) -> list[np.ndarray]:
    """Returns the first coordinates that are apart from each other."""
    chosen: list[np.ndarray] = []
    for unit in units:
        if len(chosen) < most and all(np.linalg.norm(unit - each) >= APART for each in chosen):
            chosen.append(unit)
    return chosen


def _least_determined(jacobian: np.ndarray, reach: float) -> np.ndarray:
    """Returns a matrix that maps normal numbers to steps, which change the errors equally in all directions.

    Args:
        jacobian: Derivatives of the residuals, shape (residuals, m).
        reach: Standard deviation of the steps along the least determined direction; no direction has more.
    """
    _, singular, axes = np.linalg.svd(jacobian, full_matrices=False)
    smallest = max(float(singular[-1]), 1e-12)
    return np.asarray(axes.T * (reach * smallest / np.maximum(singular, smallest)))


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
