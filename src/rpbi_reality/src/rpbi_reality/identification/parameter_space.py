"""Parameters as coordinates within their bounds, and the result of a search."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from .fit_config import ParameterConfig


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
        parts: Best coordinates of each of several disjoint parts of the runs, shape (parts, m); can be empty.
    """

    unit: np.ndarray
    points: np.ndarray
    runs: np.ndarray
    residuals: list[np.ndarray]
    jacobians: list[np.ndarray]
    parts: np.ndarray
