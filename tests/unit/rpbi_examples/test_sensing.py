"""Sensed poses: noise, delay and smoothing; and where a sponge touches."""

from __future__ import annotations

import numpy as np
import pytest

from robot_model.geometry import Pose, minus, rotation_between
from rpbi_examples.scenes.parts.lanes import Patch
from rpbi_examples.scenes.sensing import DELAY_S, MEAN_OF, NOISE_M, NOISE_RAD, SensedPoses, noisy

CYCLE_S = 0.02


def track(tracker: SensedPoses, places: np.ndarray) -> np.ndarray:
    """Returns the sensed x of a body that is at some places, a cycle each [m]."""
    steps = enumerate(places.tolist(), 1)
    return np.array(
        [tracker.track(CYCLE_S * step, {"box": Pose((x, 0.0, 0.0))})["box"].position[0] for step, x in steps]
    )


def test_measurements_have_the_noise_of_the_page():
    rng, pose = np.random.default_rng(0), Pose((1.0, 2.0, 3.0), (0.0, 0.6, 0.0, 0.8))
    measured = [noisy(pose, rng) for _ in range(2000)]
    shifts = np.array([minus(each.position, pose.position) for each in measured])
    turns = np.array([rotation_between(pose.quat_xyzw, each.quat_xyzw) for each in measured])
    assert shifts.std(axis=0) == pytest.approx([0.002] * 3, rel=0.05) and NOISE_M == 0.002
    assert turns.std(axis=0) == pytest.approx([np.radians(1.0)] * 3, rel=0.05) and NOISE_RAD == np.radians(1.0)


def test_sensed_poses_are_late_and_follow_a_body_that_moves():
    places = np.linspace(0.0, 1.0, 51)  # 1 m/s
    late = track(SensedPoses(np.random.default_rng(1)), places)[1:] - places[:-1]
    assert np.abs(late).max() < 5.0 * NOISE_M and DELAY_S == CYCLE_S


def test_a_body_at_rest_is_smoothed():
    sensed = track(SensedPoses(np.random.default_rng(2)), np.zeros(2000))
    assert 0.1 * NOISE_M < sensed[2 * MEAN_OF :].std() < 0.2 * NOISE_M


def test_noise_is_determined_by_the_seed():
    first, again, other = (track(SensedPoses(np.random.default_rng(seed)), np.zeros(20)) for seed in (3, 3, 4))
    assert (first == again).all() and (first != other).all()


def test_a_sponge_on_its_edge_wipes_nothing():
    board = Pose((0.1, 0.2, 0.3), (0.0, 0.0, 0.6, 0.8))
    corners = [(-0.06, -0.03), (0.06, -0.03), (0.06, 0.03), (-0.06, 0.03)]
    touching = [(board @ Pose((x, y, 0.0))).position for x, y in corners]
    places = np.array([(0.0, 0.0), (0.055, 0.0), (0.055, 0.025), (0.07, 0.0)])
    assert Patch.of(board, touching).covers(places).tolist() == [True, True, True, False]
    assert Patch.of(board, touching).covers(places, 0.009).tolist() == [True, False, False, False]
    for few in (touching[:2], touching[:0]):
        assert not Patch.of(board, few).covers(places).any()
    half = Patch.of(board, touching[:3])
    assert half.covers(np.array([(0.03, 0.0), (-0.03, 0.02)])).tolist() == [True, False]
