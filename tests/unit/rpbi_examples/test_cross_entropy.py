"""The cross-entropy method finds the best of a known function, and policies are those of their parameters."""

from __future__ import annotations

import numpy as np
import pytest

from rpbi_examples.gym.cross_entropy import CrossEntropy, LinearPolicies


def test_it_finds_the_best():
    best, method = np.array([0.5, -1.0, 2.0]), CrossEntropy(3, 2.0, 0.2, 1e-3, np.random.default_rng(0))
    for _ in range(30):
        drawn = method.draw(40)
        method.update(drawn, -((drawn - best) ** 2).sum(axis=1))
    assert method.mean == pytest.approx(best, abs=0.02)
    assert (method.deviation < 0.05).all()


def test_each_environment_has_its_policy():
    weights = np.array([[1.0, 0.0, 0.0, 1.0], [0.0, 2.0, 0.0, 0.0]])
    actions = LinearPolicies(weights, 2)(np.array([[0.1, 0.2], [0.1, 0.2]]))
    assert np.arctanh(actions) == pytest.approx(np.array([[0.1, 0.2], [0.4, 0.0]]))
