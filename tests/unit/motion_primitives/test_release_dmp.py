"""The release's primitives: its model, without its faults."""

from __future__ import annotations

import math

import numpy as np
import pytest

from motion_primitives.errors import DemonstrationError, PlanError
from motion_primitives.release_dmp import LONGEST_S, ReleaseDMP, learn, plan

TIMES = np.linspace(0.0, 2.0, 101)
SHARE = 10 * (TIMES / 2) ** 3 - 15 * (TIMES / 2) ** 4 + 6 * (TIMES / 2) ** 5
SHOWN = np.stack([SHARE, 0.3 * np.sin(np.pi * SHARE)], axis=1)
PRIMITIVES, TAU = learn(TIMES, SHOWN, [100, 100], [20, 20], 4)
REQUEST = {
    "x_0": SHOWN[0], "x_dot_0": [0, 0], "t_0": 0, "goal": SHOWN[-1], "goal_thresh": [0.01, 0.01], "seg_length": -1,
    "tau": TAU, "dt": 0.02, "integrate_iter": 20,
}  # fmt: skip


def test_learned_function_follows_the_formula_of_the_release():
    assert TAU == 2.0 and len(PRIMITIVES) == 2 and PRIMITIVES[0].f_domain == tuple(TIMES / 2.0)
    index, k, d = 40, 100.0, 20.0
    t, h = TIMES[index], TIMES[1]
    x, v = SHOWN[index, 1], (SHOWN[index + 1, 1] - SHOWN[index - 1, 1]) / (2 * h)
    a = (SHOWN[index + 2, 1] - 2 * x + SHOWN[index - 2, 1]) / (2 * h) ** 2
    s, goal, start = math.exp(-math.log(100) * t / TAU), SHOWN[-1, 1], SHOWN[0, 1]
    expected = ((TAU**2 * a + d * TAU * v) / k - (goal - x) + (goal - start) * s) / s
    assert PRIMITIVES[1].f_targets[index] == pytest.approx(expected, rel=1e-9)


def test_a_demonstration_is_repeated():
    found = plan(PRIMITIVES, **{**REQUEST, "integrate_iter": 100})
    assert found.times[0] == 0.02 and found.is_at_goal
    assert found.positions[:99] == pytest.approx(SHOWN[1:100], abs=1e-3)
    assert found.velocities[1:98] == pytest.approx(np.gradient(SHOWN, TIMES, axis=0)[2:99], abs=0.01)


def test_plan_continues_until_it_reaches_another_goal():
    goal = [0.5, 1.0]
    found = plan(PRIMITIVES, **{**REQUEST, "goal": goal, "tau": 4.0})
    assert found.is_at_goal and found.times[-1] >= 4.0
    assert found.positions[-1] == pytest.approx(goal, abs=0.01)
    ignoring = plan(PRIMITIVES, **{**REQUEST, "goal": goal, "goal_thresh": [0, -1], "tau": 4.0})
    assert ignoring.is_at_goal and ignoring.times[-1] == pytest.approx(4.0)


def test_segments_and_starts_in_the_middle():
    segment = plan(PRIMITIVES, **{**REQUEST, "seg_length": 0.5})
    assert segment.times[-1] == pytest.approx(0.5) and not segment.is_at_goal
    rest = plan(PRIMITIVES, **{**REQUEST, "x_0": segment.positions[-1], "x_dot_0": segment.velocities[-1], "t_0": 0.5})
    whole = plan(PRIMITIVES, **REQUEST)
    assert rest.times[-1] == pytest.approx(1.5)
    assert rest.positions[-1] == pytest.approx(whole.positions[-1], abs=0.02)


def test_plan_begins_with_the_requested_velocity():
    found = plan(PRIMITIVES, **{**REQUEST, "x_dot_0": [1.0, 0.0], "tau": 4.0, "dt": 1e-3, "integrate_iter": 1})
    assert (found.positions[0] - SHOWN[0])[0] / 1e-3 == pytest.approx(1.0)


def test_a_goal_that_is_never_reached_ends_the_plan():
    never = [ReleaseDMP(1e-4, 1.0, (), (0.0, 1.0), (0.0, 0.0))]
    found = plan(never, [0], [0], 0, [1e6], [1e-9], -1, 1.0, 0.5, 1)
    assert not found.is_at_goal and found.times[-1] == LONGEST_S


def test_weights_count_where_there_are_no_samples():
    assert len(PRIMITIVES[0].weights) == 4
    only = [ReleaseDMP(100, 20, one.weights, (), ()) for one in learn(TIMES, SHOWN, [100, 100], [20, 20], 30)[0]]
    assert plan(only, **REQUEST).positions == pytest.approx(plan(PRIMITIVES, **REQUEST).positions, abs=0.02)


@pytest.mark.parametrize(
    "change, text",
    [
        ({"dt": 0.0}, "dt: expected a finite time above 0 s, got 0"),
        ({"dt": math.nan}, "dt: expected a finite time"),
        ({"dt": 1e-9}, "dt: expected at least"),
        ({"tau": -1.0}, "tau: expected a finite time above 0 s"),
        ({"t_0": math.inf}, "t_0: expected a finite time"),
        ({"seg_length": math.nan}, "seg_length: expected a finite time"),
        ({"integrate_iter": 0}, "integrate_iter: expected at least 1, got 0"),
        ({"goal": [1.0]}, r"goal: expected 2 finite numbers, one for each dimension, got \[1.0\]"),
        ({"goal_thresh": []}, "goal_thresh: expected 2 finite numbers"),
        ({"x_0": [0.0, math.nan]}, "x_0: expected 2 finite numbers"),
        ({"x_dot_0": [0.0] * 3}, "x_dot_0: expected 2 finite numbers"),
    ],
)
def test_a_request_that_makes_no_sense(change, text):
    with pytest.raises(PlanError, match=text):
        plan(PRIMITIVES, **{**REQUEST, **change})
    with pytest.raises(PlanError, match="dmp_list: expected primitives; call set_active_dmp first, got none"):
        plan([], **REQUEST)


@pytest.mark.parametrize(
    "arguments, error, text",
    [
        ((TIMES[:2], SHOWN[:2], [1, 1], [1, 1], 0), DemonstrationError, "at least 3 samples, got 2"),
        (([0, 1, 1], SHOWN[:3], [1, 1], [1, 1], 0), DemonstrationError, "which repeats"),
        (([0, 1], SHOWN[:3], [1, 1], [1, 1], 0), DemonstrationError, "times: expected 3 numbers, as many as points"),
        ((TIMES, SHOWN, [1], [1, 1], 0), PlanError, "k_gains: expected 2 finite numbers"),
        ((TIMES, SHOWN, [1, 0], [1, 1], 0), PlanError, "k_gains and d_gains: expected numbers above 0"),
        ((TIMES, SHOWN, [1, 1], [1, 1], -1), PlanError, "num_bases: expected at least 0, got -1"),
    ],
)
def test_a_demonstration_that_makes_no_sense(arguments, error, text):
    with pytest.raises(error, match=text):
        learn(*arguments)


@pytest.mark.parametrize(
    "fields, text",
    [
        ((0.0, 1.0, (), (0.0, 1.0), (0.0, 1.0)), "k_gain: expected a finite number above 0"),
        ((1.0, 1.0, (), (0.0, 1.0), (0.0,)), "f_targets: expected 2 numbers, as many as f_domain, got 1"),
        ((1.0, 1.0, (), (0.0, 0.0), (0.0, 1.0)), "f_domain: expected increasing numbers"),
        ((1.0, 1.0, (), (0.0, 1.0), (0.0, math.inf)), "f_targets: expected finite numbers"),
        ((1.0, 1.0, (), (), ()), "f_domain: expected samples of the forcing term, or weights, got neither"),
    ],
)
def test_a_primitive_that_makes_no_sense(fields, text):
    with pytest.raises(PlanError, match=text):
        ReleaseDMP(*fields)
