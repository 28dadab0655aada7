"""Uncertainty of identified parameters: bootstrap over runs, profiles, and directions that the data cannot tell."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from scipy.stats import norm, t

from .fit_config import FitConfig
from .parameter_space import Found, ParameterSpace

ROUNDS = 2000
RIDGE = 1e-3
"""Weight that keeps steps finite along directions which the errors do not depend on."""
FLAT = 0.5
"""Standard deviation in units of the bounds from which the data do not tell a parameter."""


class Uncertainty(NamedTuple):
    """Uncertainty of all parameters.

    Attributes:
        intervals: 95 % interval of each parameter, by bootstrap over the runs (blocks of time for a single run).
        profiles: For the two parameters with the widest intervals: values, and the increase of the error after all
            other parameters are fitted again.
        alike: Groups of parameters that the data cannot tell apart.
    """

    intervals: Mapping[str, tuple[float, float]]
    profiles: Mapping[str, list[tuple[float, float]]]
    alike: list[tuple[str, ...]]


def uncertainty(config: FitConfig, found: Found) -> Uncertainty:
    """Computes the uncertainty from what a search has evaluated, without further simulations.

    Least squares: one Gauss-Newton step from the optimum for each resample of runs. CMA-ES: for each resample, the
    minimum of a quadratic function that is fitted to the errors of the evaluated candidates. These are resampled too,
    since contacts make their errors rough.
    """
    space = ParameterSpace(config.parameters)
    random = np.random.default_rng(config.seed)
    if found.jacobians:
        shifts, hessian, count = _gauss_newton(space, found, random)
    else:
        shifts, hessian, count = _surrogate(found, random)
    low, high = (_percentile(shifts, percent) for percent in (lower_percent(count), 100.0 - lower_percent(count)))
    if len(found.parts):
        reach = _reach_of_parts(found)
        low, high = np.minimum(low, -reach), np.maximum(high, reach)
    lowest, highest = (space.values(found.unit + side) for side in (low, high))
    intervals = {name: (lowest[name], highest[name]) for name in space.names}
    spread = shifts.std(0)
    worst = np.argsort(-spread)[:2]
    profiles = {space.names[i]: _profile(space, found.unit, hessian, int(i)) for i in worst}
    return Uncertainty(intervals, profiles, _alike(space, hessian, spread))


def lower_percent(count: int) -> float:
    """Returns the percentile at which a 95 % interval begins: 2.5 for many runs, less for few.

    A resample of few runs varies too little, and the tails are heavier than those of a normal distribution (expanded
    percentile interval, Hesterberg 2015).

    Args:
        count: Number of resampled runs.
    """
    count = max(count, 2)
    return float(100.0 * norm.cdf(t.ppf(0.025, count - 1) * np.sqrt(count / (count - 1))))


def _percentile(shifts: np.ndarray, percent: float) -> np.ndarray:
    """Returns a percentile of shifts; the interval includes the median, for a search that ended early.

    Args:
        shifts: Shift of the optimum for each resample, shape (rounds, m).
        percent: The percentile; below 50, the lower end of an interval.
    """
    raw = np.percentile(shifts, percent, axis=0)
    centred = raw - np.median(shifts, axis=0)
    ends: np.ndarray = np.minimum(raw, centred) if percent < 50.0 else np.maximum(raw, centred)
    return ends


def _reach_of_parts(found: Found) -> np.ndarray:
    """Returns half the width of 95 % intervals from the best values of disjoint parts of the runs, shape (m,).

    The derivatives at the best values do not know of other minima, in which a search can end. The parts do: each of
    them has minima of its own (batch means, Law 2014, section 9.5.3; the distances are those from the result).
    """
    count = len(found.parts)
    deviation = np.sqrt(((found.parts - found.unit) ** 2).mean(0))
    half: np.ndarray = t.ppf(0.975, count) * deviation / np.sqrt(count)
    return half


def _gauss_newton(
    space: ParameterSpace, found: Found, random: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, int]:
    """Returns the shift of the optimum for each resample, the curvature, and the number of resampled blocks."""
    blocks = list(zip(found.residuals, found.jacobians))
    if len(blocks) < 8:  # resample blocks of time within runs
        blocks = [
            (row * np.sqrt(parts), jacobian * np.sqrt(parts))
            for residual, matrix in blocks
            for parts in [max(1, 40 // len(blocks))]
            for row, jacobian in zip(np.array_split(residual, parts), np.array_split(matrix, parts))
        ]
    weights = [1.0 / np.sqrt(1.0 + (row / 0.5) ** 2) for row, _ in blocks]
    squares = np.array([(jacobian * w[:, None]).T @ jacobian for (_, jacobian), w in zip(blocks, weights)])
    gradients = np.array([(jacobian * w[:, None]).T @ row for (row, jacobian), w in zip(blocks, weights)])
    count = len(space.names)
    prior = np.zeros((count, count))
    values = space.values(found.unit)
    step = 1e-4
    columns = [(space.prior(space.values(found.unit + step * e)) - space.prior(values)) / step for e in np.eye(count)]
    if columns and len(columns[0]):
        matrix = np.stack(columns, 1)
        prior = matrix.T @ matrix
    full = squares.sum(0) + prior
    ridge = RIDGE * np.eye(count) * np.trace(full) / count * 1e-6
    often = _resamples(len(blocks), random)
    slopes = (often @ gradients)[:, :, None]
    shifts = -np.linalg.solve(np.einsum("rb,bij->rij", often, squares) + prior + ridge, slopes)[:, :, 0]
    return shifts, full, len(blocks)


def _resamples(count: int, random: np.random.Generator) -> np.ndarray:
    """Returns how often each run is in each resample, shape (rounds, count)."""
    return random.multinomial(count, np.full(count, 1.0 / count), ROUNDS).astype(float)


def _quadratic(points: np.ndarray) -> np.ndarray:
    """Returns the columns of a quadratic polynomial: 1, x_i, x_i x_j."""
    count = points.shape[1]
    pairs = [points[:, i] * points[:, j] for i in range(count) for j in range(i, count)]
    return np.column_stack([np.ones(len(points)), points, *pairs])


def _surrogate(found: Found, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray, int]:
    """Returns the shift of the optimum for each resample, the curvature, and the number of runs."""
    count = len(found.unit)
    centred = found.points - found.unit
    scale = np.maximum(centred.std(0), 1e-6)
    design = _quadratic(centred / scale)
    regular = np.eye(design.shape[1]) * 1e-2
    regular[0, 0] = 0.0
    capped = np.minimum(found.runs, np.percentile(found.runs, 99))

    def minimum(means: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        weighted = design.T * weights
        coefficients = np.linalg.solve(weighted @ design + regular, weighted @ means)
        gradient = coefficients[1 : 1 + count]
        hessian = np.zeros((count, count))
        hessian[np.triu_indices(count)] = coefficients[1 + count :]
        hessian = hessian + hessian.T
        values, vectors = np.linalg.eigh(hessian)
        values = np.maximum(values, 1e-2 * max(values.max(), 1e-9))  # no curvature is taken from noise
        step = -vectors @ ((vectors.T @ gradient) / values)
        return np.clip(step, -3.0, 3.0), (vectors * values) @ vectors.T

    candidates, runs = capped.shape
    _, hessian = minimum(capped.mean(1), np.ones(candidates))
    means, weights = _resamples(runs, random) @ capped.T / runs, _resamples(candidates, random)
    steps = np.array([minimum(*each)[0] for each in zip(means, weights)])
    return steps * scale, hessian / np.outer(scale, scale) / 2.0, runs


def _profile(space: ParameterSpace, unit: np.ndarray, hessian: np.ndarray, index: int) -> list[tuple[float, float]]:
    """Returns values of a parameter, and the increase of the error with all other parameters fitted again."""
    others = [i for i in range(len(unit)) if i != index]
    curvature = hessian[index, index]
    if others:
        inner = hessian[np.ix_(others, others)] + 1e-9 * np.eye(len(others))
        curvature -= hessian[index, others] @ np.linalg.solve(inner, hessian[others, index])
    rows = []
    for shift in np.linspace(-0.2, 0.2, 9):
        place = unit.copy()
        place[index] = np.clip(unit[index] + shift, 0.0, 1.0)
        rows.append(
            (space.values(place)[space.names[index]], float(max(curvature, 0.0) * (place[index] - unit[index]) ** 2))
        )
    return rows


def _alike(space: ParameterSpace, hessian: np.ndarray, spread: np.ndarray) -> list[tuple[str, ...]]:
    """Returns the parameters of directions along which the error hardly changes."""
    scale = np.sqrt(np.maximum(np.diag(hessian), 1e-12))
    values, vectors = np.linalg.eigh(hessian / np.outer(scale, scale))
    groups = []
    for value, vector in zip(values, vectors.T):
        names = tuple(space.names[i] for i in np.flatnonzero(abs(vector) > 0.35))
        if value < 0.02 and len(names) > 1:
            groups.append(names)
    groups += [(space.names[i],) for i in np.flatnonzero(spread > FLAT)]
    return list(dict.fromkeys(groups))
