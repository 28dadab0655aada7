"""Noise of depths: how much, where, and always the same."""

from __future__ import annotations

import numpy as np
import pytest

from rpbi.render.camera import DepthNoise

NEAR_M, FAR_M = 0.1, 10.0


def noisy(noise, depth_m=2.0, tick=7, shape=(200, 300)):
    image = np.full(shape, depth_m, np.float32)
    noise.add_to(image, tick, NEAR_M, FAR_M)
    return image


@pytest.mark.parametrize("depth_m, deviation_m", [(1.0, 0.003 + 0.002), (3.0, 0.003 + 0.018)])
def test_deviation_is_a_constant_plus_a_term_of_squared_depth(depth_m, deviation_m):
    image = noisy(DepthNoise(0.003, 0.002, 1), depth_m)
    assert image.std() == pytest.approx(deviation_m, rel=0.02)
    assert image.mean() == pytest.approx(depth_m, abs=5 * deviation_m / np.sqrt(image.size))


def test_noise_depends_only_on_seed_and_tick():
    noise = DepthNoise(0.01, 0.0, 3)
    first = noisy(noise)
    noisy(noise, tick=8)
    assert np.array_equal(noisy(noise), first)
    assert np.array_equal(noisy(DepthNoise(0.01, 0.0, 3)), first)


@pytest.mark.parametrize("other", [{"seed": 4}, {"tick": 8}])
def test_other_seeds_and_ticks_give_other_noise(other):
    seed, tick = other.get("seed", 3), other.get("tick", 7)
    assert not np.array_equal(noisy(DepthNoise(0.01, 0.0, seed), tick=tick), noisy(DepthNoise(0.01, 0.0, 3)))


def test_empty_pixels_stay_at_the_far_plane_others_within_range():
    noise = DepthNoise(1.0, 0.0, 1)
    assert np.all(noisy(noise, FAR_M) == np.float32(FAR_M))
    near, far = noisy(noise, 0.2), noisy(noise, 9.9)
    assert near.min() == np.float32(NEAR_M) and far.max() == np.float32(FAR_M)
