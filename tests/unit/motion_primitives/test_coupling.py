"""Motions that give way to forces, and that go around obstacles."""

from __future__ import annotations

import math

import numpy as np
import pytest
from shown_motions import reach, stir

from motion_primitives import ForceCoupling, ObstacleCoupling, make_primitive

NAMES = ("dmp", "promp")
LEARNED = {name: make_primitive(name, {}).learn([reach(seed) for seed in range(3)]) for name in NAMES}


@pytest.mark.parametrize("name", NAMES)
def test_force_deflects_the_motion_like_a_spring_until_it_ends(name):
    goal, force = reach().points[-1], ForceCoupling(stiffness=[200.0] * 3 + [10.0] * 3)
    execution = LEARNED[name].begin(goal=goal, duration_s=2.0)
    force.force = [0.0, 0.0, 10.0, 0.0, 1.0, 0.0]
    for _ in range(400):
        execution.step(0.01, [force])
    shift = execution.space.minus(execution.state.point, goal)
    assert shift == pytest.approx([0.0, 0.0, 0.05, 0.0, 0.1, 0.0], abs=1e-5)
    assert not execution.is_at_goal()
    force.force = 0.0
    for _ in range(400):
        execution.step(0.01, [force])
    assert execution.is_at_goal()


def test_rhythm_yields_to_a_force():
    primitive, force = make_primitive("rhythmic_dmp", {}).learn(stir()), ForceCoupling(100.0, [5.0, 0, 0, 0, 0, 0])
    pushed, free = primitive.plan(couplings=[force]), primitive.plan()
    assert (pushed.positions - free.positions)[-100:, 0] == pytest.approx(0.05, abs=1e-4)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("seed", range(6))
def test_obstacle_near_the_path_is_avoided_and_the_goal_reached(name, seed):
    rng = np.random.default_rng(seed)
    free = LEARNED[name].plan(dt_s=0.02)
    center = free.positions[rng.integers(30, 70) * len(free.times) // 100] + rng.normal(0.0, 0.01, 3)
    obstacle = ObstacleCoupling(center, radius_m=0.05)
    assert np.linalg.norm(free.positions - center, axis=1).min() < obstacle.radius_m
    plan = LEARNED[name].plan(dt_s=0.02, couplings=[obstacle])
    assert np.linalg.norm(plan.positions - center, axis=1).min() > obstacle.radius_m
    assert plan.positions[-1] == pytest.approx(free.positions[-1], abs=1e-3)


def test_an_obstacle_exactly_ahead_is_avoided():
    times = np.linspace(0.0, 2.0, 201)
    share = np.sin(np.linspace(0.0, 0.5 * math.pi, 201)) ** 2
    from motion_primitives import Demonstration

    straight = make_primitive("dmp", {}).learn(Demonstration.of(times, np.outer(share, [0.6, 0.0, 0.0])))
    plan = straight.plan(couplings=[ObstacleCoupling([0.3, 0.0, 0.0], radius_m=0.05)])
    assert np.linalg.norm(plan.positions - [0.3, 0.0, 0.0], axis=1).min() > 0.05


def test_an_obstacle_that_is_passed_or_far_changes_nothing():
    primitive = LEARNED["dmp"]
    behind = ObstacleCoupling(reach().points[0, :3] + [0.0, -0.3, -0.3])
    far = ObstacleCoupling([0.0, 3.0, 0.3])
    assert primitive.plan(couplings=[behind, far]).points == pytest.approx(primitive.plan().points, abs=1e-4)


def test_values_that_make_no_sense():
    with pytest.raises(ValueError, match="stiffness: expected numbers above 0, got 0"):
        ForceCoupling(0)
    with pytest.raises(ValueError, match="radius_m: expected a number above 0, got -1"):
        ObstacleCoupling([0, 0, 0], -1)
    with pytest.raises(ValueError, match="center: must be finite"):
        ObstacleCoupling([0, 0, math.nan])
