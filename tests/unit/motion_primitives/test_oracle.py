"""The primitives against another library, by numbers that dev/tools/primitives/oracle.py has written."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from motion_primitives import Demonstration, Primitive, make_primitive
from motion_primitives.basis import GaussianBasis
from motion_primitives.dynamics import Execution
from motion_primitives.primitives.promp import Known, WeightDistribution
from motion_primitives.space import Space

ORACLE = json.loads((Path(__file__).parent / "oracle.json").read_text())
LOOKS = np.array(ORACLE["looks"])
BASES = 10
STEPS = 100
"""Steps between two looks."""


def of_oracle(key: str) -> dict[str, Any]:
    return {name: np.array(value) if isinstance(value, list) else value for name, value in ORACLE[key].items()}


def with_weights(weights: np.ndarray, space: Space, start: np.ndarray, goal: np.ndarray, attractor: str) -> Primitive:
    primitive = make_primitive("dmp", {"bases": BASES, "attractor": attractor})
    learned = {"start": start.tolist(), "goal": goal.tolist(), "duration_s": 1.0, "weights": weights.tolist()}
    primitive.restore(space, primitive.Learned.parse(learned, "test"))
    return primitive


def at_looks(execution: Execution) -> np.ndarray:
    found = [execution.state.point]
    for before, after in zip(LOOKS, LOOKS[1:]):
        found.append([execution.step((after - before) / STEPS) for _ in range(STEPS)][-1].point)
    return np.array(found)


def test_motions_to_a_fixed_goal():
    expected = of_oracle("fixed")
    primitive = with_weights(expected["weights"], Space(("x", "y", "z")), expected["start"], expected["goal"], "fixed")
    assert at_looks(primitive.begin()) == pytest.approx(expected["positions"], abs=1e-6)


def test_motions_to_a_moving_goal():
    expected = of_oracle("moving")
    primitive = with_weights(expected["weights"], Space(("x", "y", "z")), expected["start"], expected["goal"], "moving")
    assert at_looks(primitive.begin()) == pytest.approx(expected["positions"], abs=1e-6)


def test_orientations_to_a_fixed_goal():
    expected = of_oracle("orientations")
    weights = np.vstack([np.zeros((1, BASES)), expected["weights"]])
    start, goal = ([0.0, *expected[name][[1, 2, 3, 0]]] for name in ("start", "goal"))
    primitive = with_weights(weights, Space(("x",), True), np.array(start), np.array(goal), "fixed")
    found, wxyz = at_looks(primitive.begin())[:, 1:], expected["quats_wxyz"]
    cosine = np.abs(np.sum(found * wxyz[:, [1, 2, 3, 0]], axis=1))
    assert cosine == pytest.approx(1.0, abs=1e-12)
    signs = np.sign(np.sum(found * wxyz[:, [1, 2, 3, 0]], axis=1))[:, None]
    assert found == pytest.approx(signs * wxyz[:, [1, 2, 3, 0]], abs=1e-6)


def test_forcing_terms_of_a_fixed_goal_equal_the_oracles():
    """Forcing terms are compared: of weights that hardly count at the end, both libraries have other ones."""
    shown = of_oracle("demonstration")
    demonstration = Demonstration.of(shown["times"], shown["positions"], shown["quats_xyzw"])
    primitive = make_primitive("dmp", {"bases": BASES, "attractor": "fixed"}).learn(demonstration)
    found, values = np.array(primitive.learned().weights), GaussianBasis.of(BASES).values(shown["times"])
    for key, columns, tolerance in (
        ("fixed", slice(0, 3), 1e-6),
        ("orientations", slice(3, 6), 1e-3),  # angular velocities by other differences, both of second order
    ):
        expected = values @ of_oracle(key)["weights"].T
        assert values @ found[columns].T == pytest.approx(expected, abs=tolerance * np.abs(expected).max())


def test_distributions_of_motions():
    expected = of_oracle("promp")
    primitive = make_primitive("promp", {"bases": BASES})
    learned = {"origin": [0.0] * 3, "duration_s": 1.0, "weights": np.zeros((1, 3, BASES)).tolist()}
    primitive.restore(Space(("x", "y", "z")), primitive.Learned.parse(learned, "test"))
    free = WeightDistribution(expected["weight_mean"], expected["weight_covariance"])
    known = [Known("point", share, point, 1e-2) for share, point in zip((0.3, 1.0), expected["points"])]
    given = primitive.given(free, known)
    for distribution, mean, variance in ((free, "mean", "variance"), (given, "given_mean", "given_variance")):
        found = [primitive.mean_at(distribution, share)[0] for share in LOOKS]
        assert np.array(found) == pytest.approx(expected[mean], abs=1e-6)
        assert primitive.stds(LOOKS, distribution) ** 2 == pytest.approx(expected[variance], abs=1e-6)
    rates = [primitive.mean_at(free, share)[1] for share in LOOKS]
    assert np.array(rates) == pytest.approx(expected["velocities"], abs=1e-6)
