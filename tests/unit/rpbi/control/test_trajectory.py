"""Trajectories pass through their knots, smoothly as far as these say, and can be spliced."""

from __future__ import annotations

import random

import numpy as np
import pytest

from rpbi.control.trajectories.polynomial import derivative, quintic, value_bounds, value_range
from rpbi.control.trajectories.trajectory import DesiredState, Knot, Trajectory, minimum_jerk

KINDS = {"line": (), "cubic": ("velocity",), "quintic": ("velocity", "acceleration")}


def knots(kind: str, count: int = 6, joints: int = 3, seed: int = 1) -> list[Knot]:
    """Returns knots with random values at random times."""
    source = random.Random(seed)

    def values() -> tuple[float, ...]:
        return tuple(source.uniform(-2.0, 2.0) for _ in range(joints))

    times = np.cumsum([source.uniform(0.05, 3.0) for _ in range(count)])
    return [Knot(float(t), values(), **{name: values() for name in KINDS[kind]}) for t in times]


def sample_just_before(trajectory: Trajectory, time_s: float) -> DesiredState:
    return trajectory.sample(time_s - 1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_trajectory_passes_through_positions_and_derivatives_of_its_knots(kind):
    given = knots(kind)
    trajectory = Trajectory.through(given)
    for knot in given[:-1]:
        state = trajectory.sample(knot.time_s)
        assert state.position == pytest.approx(knot.position, abs=1e-9)
        for name in KINDS[kind]:
            assert getattr(state, name) == pytest.approx(getattr(knot, name), abs=1e-9)
    for knot in given[1:]:
        state = sample_just_before(trajectory, knot.time_s)
        assert state.position == pytest.approx(knot.position, abs=1e-6)
        for name in KINDS[kind]:
            assert getattr(state, name) == pytest.approx(getattr(knot, name), abs=1e-4)


@pytest.mark.parametrize("kind", KINDS)
def test_velocity_and_acceleration_are_the_derivatives_of_the_position(kind):
    trajectory = Trajectory.through(knots(kind))
    h = 1e-4
    for time_s in np.linspace(trajectory.start_s + 0.01, trajectory.end_s - 0.01, 300):
        if min(abs(time_s - segment.start_s) for segment in trajectory.segments) < 2 * h:
            continue
        before, here, after = (np.array(trajectory.sample(time_s + dt)) for dt in (-h, 0.0, h))
        assert here[1:] == pytest.approx((after - before)[:2] / (2 * h), abs=2e-3, rel=1e-4)


def test_line_is_straight_if_one_knot_has_only_a_position():
    trajectory = Trajectory.through([Knot(0.0, (0.0,), (5.0,)), Knot(2.0, (4.0,))])
    assert [trajectory.sample(t).position[0] for t in (0.0, 0.5, 1.5)] == [0.0, 1.0, 3.0]
    assert trajectory.sample(0.0).velocity == (2.0,)


def test_trajectory_rests_before_its_start_and_after_its_end():
    given = knots("quintic")
    trajectory = Trajectory.through(given)
    still = (0.0,) * 3
    assert trajectory.sample(trajectory.start_s - 1.0) == (given[0].position, still, still)
    for late_s in (0.0, 1e-12, 5.0):
        assert trajectory.sample(trajectory.end_s + late_s) == (given[-1].position, still, still)


def test_one_knot_means_rest():
    trajectory = Trajectory.through([Knot(3.0, (1.0, 2.0))])
    assert (trajectory.start_s, trajectory.end_s) == (3.0, 3.0)
    assert {trajectory.sample(t).position for t in (0.0, 3.0, 9.0)} == {(1.0, 2.0)}


def test_minimum_jerk_has_the_known_profile():
    trajectory = minimum_jerk((1.0, 0.0), (3.0, -1.0), 5.0, 2.0)
    middle = trajectory.sample(6.0)
    assert middle.position == pytest.approx((2.0, -0.5))
    assert middle.velocity == pytest.approx((15 / 8, -15 / 16))  # 15/8 of the mean velocity
    assert middle.acceleration == pytest.approx((0.0, 0.0), abs=1e-12)
    assert trajectory.sample(7.0).position == (3.0, -1.0)


@pytest.mark.parametrize("at_s", [-1.0, 0.0, 0.3, 1.0, 1.5, 2.0, 2.7, 3.0, 4.5, 6.0, 9.0])
def test_spliced_trajectory_follows_the_old_one_then_the_new_one(at_s):
    old = Trajectory.through([Knot(0.0, (0.0,), (0.0,)), Knot(1.0, (2.0,), (1.0,)), Knot(3.0, (1.0,), (0.0,))])
    new = Trajectory.through([Knot(2.0, (5.0,)), Knot(4.0, (6.0,)), Knot(6.0, (3.0,))])
    spliced = old.spliced(new, at_s)
    for time_s in np.arange(0.0, 10.0, 0.05):
        expected = (old if time_s < at_s else new).sample(time_s)
        if at_s > 0.0 or time_s >= new.start_s:  # before both there is nothing to be told apart
            assert np.array(spliced.sample(time_s)) == pytest.approx(np.array(expected), abs=1e-12)
    assert spliced.goal == new.goal


def test_splicing_again_and_again_keeps_no_segments_that_are_over():
    trajectory = Trajectory.through([Knot(0.0, (0.0,))])
    for number in range(1000):
        new = Trajectory.through([Knot(number + 1.0, (0.0,)), Knot(number + 2.0, (1.0,))])
        trajectory = trajectory.since(number).spliced(new, number + 1.0)
    assert len(trajectory.segments) < 5


def test_shifted_is_the_same_motion_elsewhere():
    trajectory = Trajectory.through(knots("quintic"))
    shifted = trajectory.shifted(10.0, (1.0, 2.0, 3.0))
    for time_s in np.linspace(trajectory.start_s - 1.0, trajectory.end_s + 1.0, 50):
        expected = np.array(trajectory.sample(time_s)) + [[1.0, 2.0, 3.0], [0.0] * 3, [0.0] * 3]
        assert np.array(shifted.sample(time_s + 10.0)) == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize(
    "given, message",
    [
        ([], "at least one knot"),
        ([Knot(0.0, (0.0,)), Knot(0.0, (1.0,))], "knot 1: expected a time after 0 s"),
        ([Knot(float("nan"), (0.0,))], "knot 0"),
        ([Knot(0.0, (0.0,)), Knot(1.0, (1.0, 2.0))], "knot 1: expected 1 values of position, got 2"),
        ([Knot(0.0, (0.0,)), Knot(1.0, (float("inf"),))], "knot 1: position is not finite"),
        ([Knot(0.0, (0.0,), None, (1.0,))], "knot 0: has accelerations but no velocities"),
    ],
)
def test_invalid_knots_are_refused(given, message):
    with pytest.raises(ValueError, match=message):
        Trajectory.through(given)


def test_range_of_a_polynomial_is_found_and_its_bounds_hold():
    source = random.Random(3)
    for _ in range(300):
        duration_s = 10 ** source.uniform(-3, 2)
        scale = [source.uniform(-2, 2) / duration_s**power for power in (0, 0, 1, 1, 2, 2)]
        polynomial = quintic(duration_s, *scale)
        for each in (polynomial, derivative(polynomial)):
            values = np.polynomial.polynomial.polyval(np.linspace(0.0, duration_s, 2001), each)
            low, high = value_range(each, duration_s)
            span = high - low + 1e-12
            assert values.min() == pytest.approx(low, abs=1e-5 * span) and low <= values.min() + 1e-9 * span
            assert values.max() == pytest.approx(high, abs=1e-5 * span) and high >= values.max() - 1e-9 * span
            lower, upper = value_bounds([each], [duration_s])
            assert lower[0] <= low + 1e-9 * span and upper[0] >= high - 1e-9 * span
