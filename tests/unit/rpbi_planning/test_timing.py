"""Timed paths: limits, ends at rest, continuity, and bounds on the motion between two times."""

from __future__ import annotations

import numpy as np
import pytest

from rpbi_planning.timing import PathTiming, PlannedTrajectory, TimingLimits

LIMITS = TimingLimits(np.array((1.0, 2.0, 0.5)), np.array((4.0, 3.0, 5.0)), np.array((30.0, 40.0, 20.0)))
NAMES = ("a", "b", "c")


def random_path(seed: int, count: int, scale: float = 1.0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-scale, scale, (count, 3))


def timing(path: np.ndarray) -> PathTiming:
    return PathTiming(NAMES, path, LIMITS)


def exceeded(trajectory: PlannedTrajectory, limits: TimingLimits) -> bool:
    rates = trajectory.velocities, trajectory.accelerations, trajectory.jerks
    return any((np.abs(rate) > limit * (1.0 + 1e-9)).any() for rate, limit in zip(rates, limits))


@pytest.mark.parametrize("seed", range(12))
def test_limits_are_kept(seed):
    path = random_path(seed, 2 + seed % 6, 10.0 ** (1 - seed % 4))
    trajectory = timing(path).trajectory
    assert not exceeded(trajectory, LIMITS)
    assert np.allclose(trajectory.at(0.0), path[0]) and np.allclose(trajectory.at(trajectory.duration_s), path[-1])
    assert not trajectory.velocities[[0, -1]].any() and not trajectory.accelerations[[0, -1]].any()


def test_exceeded_limits_are_noticed():
    trajectory = timing(random_path(1, 4)).trajectory.slower(0.9)
    assert exceeded(trajectory, LIMITS)


@pytest.mark.parametrize("seed", range(6))
def test_curve_is_the_integral_of_its_rates(seed):
    trajectory = timing(random_path(seed, 5)).trajectory
    times = np.linspace(0.0, trajectory.duration_s, 20_001)
    q, v, a, _ = trajectory._sampled(times)
    dt = times[1]
    assert np.abs(np.diff(q, axis=0) / dt - (v[1:] + v[:-1]) / 2.0).max() < 1e-5
    assert np.abs(np.diff(v, axis=0) / dt - (a[1:] + a[:-1]) / 2.0).max() < 1e-2
    assert np.abs(np.diff(a, axis=0)).max() <= LIMITS.jerk.max() * dt * 1.001


@pytest.mark.parametrize("seed", range(6))
def test_variation_bounds_the_motion(seed):
    trajectory, random = timing(random_path(seed, 6)).trajectory, np.random.default_rng(seed)
    start, end = np.sort(random.uniform(0.0, trajectory.duration_s, (2, 50)), axis=0)
    bounds = trajectory.variation(start, end)
    for a, b, bound in zip(start, end, bounds):
        q = trajectory.at(np.linspace(a, b, 400))
        assert (np.abs(np.diff(q, axis=0)).sum(axis=0) <= bound + 1e-9).all()


def test_stop_passes_through_the_waypoint():
    path = np.array(((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0)))
    timed = timing(path)
    rounded = timed.trajectory
    times = np.linspace(0.0, rounded.duration_s, 5000)
    assert np.linalg.norm(rounded.at(times) - path[1], axis=1).min() > 1e-3
    assert timed.stop_near(rounded.duration_s / 2.0) and not timed.stop_near(0.0)
    stopped = timed.trajectory
    assert stopped.duration_s > rounded.duration_s
    times = np.linspace(0.0, stopped.duration_s, 5000)
    assert np.linalg.norm(stopped.at(times) - path[1], axis=1).min() < 1e-3


def test_single_waypoint_is_a_motion_of_no_duration():
    trajectory = timing(np.zeros((3, 3))).trajectory
    assert trajectory.duration_s == 0.0 and (trajectory.at(1.0) == 0.0).all()
