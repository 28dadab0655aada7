"""Steps of the search by least squares, on functions with jumps and valleys."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from rpbi_reality.identification.evaluator import Evaluation
from rpbi_reality.identification.fit_config import FitConfig
from rpbi_reality.identification.least_squares import _Runs, loss, search_by_least_squares
from rpbi_reality.identification.parameter_space import ParameterSpace

CONFIG = FitConfig.parse(
    {
        "measured": {"box": {"object": "box"}},
        "parameters": {name: {"set": f"box.{name}", "bounds": [0.0, 1.0]} for name in ("a", "b")},
        "evaluations": 400,
    },
    "fit.yaml",
)
SPACE = ParameterSpace(CONFIG.parameters)


class Function:
    """Evaluates residuals that are a function of two parameters and of the run's number."""

    def __init__(self, residuals: Callable[[float, float, int], list[float]]) -> None:
        self.count, self.simulated, self.problems = 0, 0, dict[str, int]()
        self._residuals = residuals

    def __call__(self, candidates, runs):
        self.count += len(candidates)
        self.simulated += len(candidates) * len(runs)
        tables = [[np.array(self._residuals(each["a"], each["b"], run)) for run in runs] for each in candidates]
        return [Evaluation(np.array([(row**2).sum() for row in rows]), rows) for rows in tables]


def among(residuals: Callable[[float, float, int], list[float]], runs: int = 1) -> _Runs:
    return _Runs(SPACE, Function(residuals), range(runs), lambda _: None)


def test_settling_moves_the_directions_that_improve():
    def with_wall(a: float, b: float, _: int) -> list[float]:
        return [0.1 * (a - 0.6) + (1.0 if a > 0.52 else 0.0), b - 0.3]

    start = np.array([0.5, 0.5])
    assert among(with_wall).settle(start) == pytest.approx([0.5, 0.3], abs=1e-3)
    assert among(lambda a, b, _: [a - 0.6, b - 0.3]).settle(start) == pytest.approx([0.6, 0.3], abs=2e-2)


def test_leap_corrects_its_random_steps():
    def curved(a: float, b: float, _: int) -> list[float]:
        return [3.0 * (b - a**2), a - 0.6 + (0.5 if a < 0.53 else 0.0)]

    def lost(unit: np.ndarray) -> float:
        return loss(np.array(curved(*unit, 0)))

    start = np.array([0.5, 0.25])
    ends = [among(curved).leap(start, 0.1, 20, np.random.default_rng(seed)) for seed in range(5)]
    assert max(map(lost, ends)) < 0.01 * lost(start)


def test_parts_show_minima_that_derivatives_do_not():
    def rippled(a: float, b: float, run: int) -> list[float]:
        return [a - 0.4 + 0.03 * np.sin(60.0 * a + run), b - 0.6]

    found = search_by_least_squares(CONFIG, SPACE, Function(rippled), range(20), lambda _: None)
    assert found.parts.shape == (5, 2)
    assert found.parts[:, 0].std() > 10.0 * found.parts[:, 1].std()
    assert found.unit == pytest.approx([0.4, 0.6], abs=0.05)
