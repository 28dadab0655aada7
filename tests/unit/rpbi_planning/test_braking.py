"""Braking along a path: it begins as the motion is, stays on the path, ends at rest, and keeps its acceleration."""

from __future__ import annotations

import numpy as np
import pytest

from rpbi_planning.braking import SampledMotion, braked


def curve(duration_s: float = 4.0) -> SampledMotion:
    """Returns a motion of two joints along a quarter of a circle, from rest to rest."""
    times = np.linspace(0.0, duration_s, 401)
    u = times / duration_s
    angle = np.pi / 2.0 * u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
    rate = np.gradient(angle, times)
    positions = np.column_stack([np.cos(angle), np.sin(angle)])
    velocities = rate[:, None] * np.column_stack([-np.sin(angle), np.cos(angle)])
    return SampledMotion(times, positions, velocities, np.gradient(velocities, times, axis=0))


@pytest.mark.parametrize("from_s", [0.5, 2.0, 3.5])
def test_braking_begins_as_the_motion_is_and_ends_at_rest(from_s):
    motion = curve()
    braking = braked(motion, from_s, 3.0)
    for values, expected in ((braking.positions, motion.positions), (braking.velocities, motion.velocities)):
        assert values[0] == pytest.approx([np.interp(from_s, motion.times, each) for each in expected.T])
    assert np.abs(braking.velocities[-1]).max() < 1e-9 and braking.times[0] == 0.0
    assert np.diff(braking.times).min() > 0.0


def test_braking_stays_on_the_path():
    radius = np.linalg.norm(braked(curve(), 1.5, 3.0).positions, axis=1)
    assert np.abs(radius - 1.0).max() < 1e-4
    straight_on = curve().positions[150] + 0.3 * curve().velocities[150]
    assert abs(np.linalg.norm(straight_on) - 1.0) > 1e-2, "a robot that just slowed down would leave the path"


def test_velocities_are_the_derivatives_of_positions():
    braking = braked(curve(), 2.0, 2.0)
    middles = np.diff(braking.positions, axis=0) / np.diff(braking.times)[:, None]
    means = (braking.velocities[1:] + braking.velocities[:-1]) / 2.0
    assert np.abs(middles - means).max() < 2e-2


def test_larger_acceleration_brakes_in_less_time():
    slow, fast = (braked(curve(), 2.0, each) for each in (1.0, 4.0))
    assert fast.duration_s < slow.duration_s
    added = np.abs(np.diff(slow.velocities, axis=0) / np.diff(slow.times)[:, None]).max()
    assert added < 1.0 + np.abs(curve().accelerations).max()


@pytest.mark.parametrize("acceleration", [0.0, -1.0, float("nan")])
def test_acceleration_that_is_not_positive_is_an_error(acceleration):
    with pytest.raises(ValueError, match="acceleration: expected a positive number"):
        braked(curve(), 1.0, acceleration)
