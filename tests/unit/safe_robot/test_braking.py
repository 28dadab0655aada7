"""Braking trajectories, judged by differences of the positions that they tell."""

from __future__ import annotations

import math

import numpy as np
import pytest

from safe_robot.braking import Braking

V, A, J = 2.0, 10.0, 400.0


def braking(period_s: float, velocity: float = V, acceleration: float = A, jerk: float = J, n: int = 4) -> Braking:
    return Braking(*(np.full(n, limit) for limit in (velocity, acceleration, jerk)), period_s)


@pytest.mark.parametrize("period_s", [0.001, 0.002, 0.01, 0.04])
def test_braking_from_any_state_obeys_acceleration_and_jerk_limits(period_s):
    generator = np.random.default_rng(1)
    brakes = braking(period_s)
    for _ in range(200):
        v, a = generator.uniform(-V, V, 4), generator.uniform(-A, A, 4) * 0.999
        brake = brakes.plan(v, a)
        assert brake is not None, (v, a)
        q = np.concatenate((np.zeros((1, 4)), brake.displacement))
        velocity = np.concatenate((v[None], np.diff(q, axis=0) / period_s))
        acceleration = np.concatenate((a[None], np.diff(velocity, axis=0) / period_s))
        jerk = np.diff(acceleration, axis=0) / period_s
        assert np.abs(acceleration).max() <= A and np.abs(jerk).max() <= J
        assert not brake.velocity[-1].any() and not brake.acceleration[-1].any()
        np.testing.assert_allclose(velocity[1:], brake.velocity, atol=1e-9)
        np.testing.assert_allclose(acceleration[1:], brake.acceleration, atol=1e-6)
        np.testing.assert_allclose(jerk, brake.jerk, atol=1e-2)


def test_it_is_not_much_longer_than_the_shortest_possible():
    """Of all lengths, tried one by one with least squares of another making, none is shorter by more than a step."""
    period_s = 0.01
    brakes = braking(period_s, n=1)
    generator = np.random.default_rng(2)
    for _ in range(20):
        v, a = generator.uniform(-V, V), generator.uniform(-A, A) * 0.999
        brake = brakes.plan(np.array([v]), np.array([a]))
        shortest = next(length for length in range(2, 400) if _fits(length, v * period_s, a * period_s**2, period_s))
        assert shortest <= len(brake.displacement) <= math.ceil(1.16 * shortest) + 2


def _fits(length: int, v: float, a: float, period_s: float) -> bool:
    rows = np.array((np.ones(length), np.arange(length, 0, -1)))
    jerk = np.linalg.pinv(rows) @ (-a, -v - length * a)
    return np.abs(jerk).max() <= J * period_s**3 and np.abs(a + np.cumsum(jerk)).max() <= A * period_s**2


def test_braking_from_rest_does_not_move():
    brake = braking(0.01).plan(np.zeros(4), np.zeros(4))
    assert not brake.displacement.any()


def test_braking_from_outside_the_limits_has_no_plan():
    assert braking(0.01).plan(np.zeros(4), np.array([0.0, 0.0, 0.0, 2.0 * A])) is None


def test_without_limits_it_stops_at_once():
    brake = braking(0.01, math.inf, math.inf, math.inf).plan(np.full(4, 3.0), np.full(4, 50.0))
    assert np.abs(brake.displacement).max() < 1e-12


def test_without_a_limit_of_jerk_it_keeps_that_of_acceleration():
    brake = braking(0.01, jerk=math.inf).plan(np.full(4, V), np.zeros(4))
    assert brake is not None and np.abs(brake.acceleration).max() <= A
