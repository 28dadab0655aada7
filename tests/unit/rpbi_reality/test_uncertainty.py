"""Intervals of identified parameters contain the true values as often as they promise."""

from __future__ import annotations

import numpy as np
import pytest

from rpbi_reality.identification import uncertainty as module
from rpbi_reality.identification.fit_config import FitConfig
from rpbi_reality.identification.least_squares import slopes
from rpbi_reality.identification.parameter_space import Found
from rpbi_reality.identification.uncertainty import lower_percent, uncertainty

CONFIG = FitConfig.parse(
    {
        "measured": {"box": {"object": "box"}},
        "parameters": {name: {"set": f"box.{name}", "bounds": [0.0, 1.0]} for name in ("a", "b")},
    },
    "fit.yaml",
)
TRUE = np.array([0.4, 0.6])


def _coverage(runs: int, trials: int = 300) -> float:
    """Returns how often the intervals contain the true values of a linear model, whose runs differ in noise."""
    random, inside = np.random.default_rng(7), 0
    for _ in range(trials):
        slopes = [random.normal(0.0, 1.0, (10, 2)) for _ in range(runs)]
        noise = [random.normal(0.0, 0.02 * random.uniform(0.5, 1.5), 10) for _ in range(runs)]
        shift = np.linalg.lstsq(np.concatenate(slopes), np.concatenate(noise), rcond=None)[0]
        rows = [each - slope @ shift for each, slope in zip(noise, slopes)]  # residuals are noise - slope (best - true)
        best = TRUE + shift
        found = Found(best, np.zeros((0, 2)), np.zeros((0, runs)), rows, [-slope for slope in slopes], np.zeros((0, 2)))
        intervals = uncertainty(CONFIG, found).intervals
        inside += sum(low <= true <= high for true, (low, high) in zip(TRUE, intervals.values()))
    return inside / trials / 2.0


def test_intervals_of_few_runs_hold(monkeypatch):
    monkeypatch.setattr(module, "ROUNDS", 400)
    assert 0.925 < _coverage(10) < 0.975
    monkeypatch.setattr(module, "lower_percent", lambda _: 2.5)
    assert _coverage(10) < 0.925


def test_intervals_reach_over_the_best_values_of_parts():
    rows, slope = [np.zeros(10)] * 10, [np.tile([[1.0, 0.0], [0.0, 1.0]], (5, 1))] * 10
    parts = TRUE + [[0.05, 0.0], [-0.05, 0.0], [0.05, 0.0], [-0.05, 0.0]]
    found = Found(TRUE, np.zeros((0, 2)), np.zeros((0, 10)), rows, slope, parts)
    intervals = uncertainty(CONFIG, found).intervals
    assert intervals["a"] == pytest.approx((0.4 - 0.05 * 2.776 / 2.0, 0.4 + 0.05 * 2.776 / 2.0), abs=1e-4)  # t, 4 parts
    assert intervals["b"] == pytest.approx((0.6, 0.6), abs=1e-6)


@pytest.mark.parametrize(("count", "percent"), [(10, 0.85), (20, 1.59), (10_000, 2.5)])
def test_few_runs_widen_the_percentiles(count, percent):
    assert lower_percent(count) == pytest.approx(percent, abs=0.02)


def test_slopes_do_not_count_jumps():
    smooth, jump_above, jump_below = (lambda x: x**2), (lambda x: 3.0 * x + (x > 0.5)), (lambda x: 3.0 * x - (x < 0.5))
    rows = np.array([[each(x) for each in (smooth, jump_above, jump_below)] for x in (0.49, 0.5, 0.51)])
    assert slopes(*rows, 0.01, 0.01) == pytest.approx([1.0, 3.0, 3.0])
    assert slopes(rows[0], rows[0], rows[1], 0.0, 0.01)[0] == pytest.approx(0.99)  # at the lower bound
    assert (rows[2] - rows[0])[1] / 0.02 > 50.0  # the central difference counts it
