"""Mappings: formulas, and what holds for each of them."""

from __future__ import annotations

import math
import random

import numpy as np
import pytest

from custom_ros_tools.errors import ConfigError, UnknownNameError
from operator_node.mappings import MAPPINGS
from operator_node.mappings.mapping import Mapping


def made(name: str, **options) -> Mapping:
    return MAPPINGS.make(name, options, "~config")


def random_axes(generator: random.Random, count: int = 4) -> list[float]:
    return [generator.choice((-1.0, 0.0, 1.0, generator.uniform(-1.0, 1.0))) for _ in range(count)]


@pytest.mark.parametrize("scale", [0.4, 2, [0.5], [1.0, -2.0, 0.0]])
def test_scale_is_the_product_axis_by_axis(scale):
    mapping, generator = made("scale", axes_idx=[2, 0, 3], scale=scale), random.Random(1)
    for _ in range(100):
        axes = random_axes(generator)
        assert mapping.map(axes) == pytest.approx(np.asarray(scale) * np.asarray(axes)[[2, 0, 3]])


def test_isometric_mapping_limits_the_norm_of_its_axes():
    mapping, generator = made("isometric", axes_idx=[1, 0, 2], scale=0.4), random.Random(2)
    for _ in range(100):
        a = np.asarray(random_axes(generator))[[1, 0, 2]]
        n = np.linalg.norm(a)
        expected = 0.4 * min(n, 1.0) / n * a if n else np.zeros(3)
        assert mapping.map([a[1], a[0], a[2]]) == pytest.approx(expected)
    assert math.hypot(*mapping.map([1.0, 1.0, -1.0])) == pytest.approx(0.4), "a diagonal is not faster"
    assert math.hypot(*made("scale", axes_idx=[1, 0, 2], scale=0.4).map([1.0, 1.0, -1.0])) > 0.6, "scale is otherwise"


def test_isometric_scales_axis_by_axis_after_the_limit():
    mapping = made("isometric", axes_idx=[0, 1], scale=[-0.4, 0.4])
    assert mapping.map([0.5, 0.0]) == pytest.approx((-0.2, 0.0))
    assert mapping.map([1.0, 1.0]) == pytest.approx((-0.4 / math.sqrt(2.0), 0.4 / math.sqrt(2.0)))


@pytest.mark.parametrize("name", MAPPINGS)
def test_dead_zone_gives_zero_and_full_deflection_stays_full(name):
    mapping = made(name, axes_idx=[1], dead_zone=0.2)
    axes = (-1.0, -0.6, -0.2, -0.1, 0.0, 0.2, 0.21, 1.0)
    assert [mapping.map([1.0, axis])[0] for axis in axes] == pytest.approx([-1.0, -0.5, 0, 0, 0, 0, 0.0125, 1.0])
    with pytest.raises(ConfigError, match="dead_zone"):
        made(name, axes_idx=[1], dead_zone=1.0)


@pytest.mark.parametrize("name", [*MAPPINGS, "cubed:Cubed"])
class TestEveryMapping:
    def test_axes_at_rest_are_a_zero_signal_of_its_size(self, name):
        mapping = made(name, axes_idx=[1])
        assert mapping.map([1.0, 0.0]) == (0.0,) and mapping.size == 1

    def test_signals_are_finite_and_follow_from_the_axes_alone(self, name):
        mapping, generator = made(name, axes_idx=[3]), random.Random(3)
        axes = [random_axes(generator) for _ in range(50)]
        signals = [mapping.map(each) for each in axes]
        assert all(len(each) == mapping.size and all(map(math.isfinite, each)) for each in signals)
        assert [mapping.map(each) for each in reversed(axes)] == signals[::-1]

    def test_axes_that_are_not_there_are_refused(self, name):
        with pytest.raises(ValueError, match=r"expected at least 3 axes \(axes_idx has 2\), got 2"):
            made(name, axes_idx=[2]).map([0.0, 0.0])

    @pytest.mark.parametrize(
        ("axes_idx", "told"),
        [
            (None, "axes_idx: missing, expected a list of whole numbers"),
            ([], "axes_idx: expected a list of whole numbers, got 0"),
            ([0, -1], "axes_idx[1]: must be >= 0, got -1"),
            ([0.5], "axes_idx[0]: expected a whole number, got 0.5"),
            ("0", "axes_idx: expected a list of whole numbers, got text '0'"),
            ([True], "axes_idx[0]: expected a whole number, got true"),
        ],
    )
    def test_bad_axes_idx_is_refused_with_key_expected_and_got(self, name, axes_idx, told):
        with pytest.raises(ConfigError) as error:
            made(name, **({} if axes_idx is None else {"axes_idx": axes_idx}))
        assert f"~config: {told}" in str(error.value)


@pytest.mark.parametrize(
    ("name", "scale", "told"),
    [
        ("scale", "fast", "scale: expected a number or a list of numbers, got text 'fast'"),
        ("scale", [1.0, 2.0, 3.0], "scale: expected one number, or 2 as axes_idx has, got 3"),
        ("scale", [1.0, "x"], "scale[1]: expected a number, got text 'x'"),
        ("scale", math.nan, "must be a finite number"),
        ("isometric", [1.0, 2.0, 3.0], "scale: expected one number, or 2 as axes_idx has, got 3"),
        ("isometric", math.inf, "scale: must be a finite number, got .inf"),
    ],
)
def test_bad_scale_is_refused_with_key_expected_and_got(name, scale, told):
    with pytest.raises(ConfigError) as error:
        made(name, axes_idx=[0, 1], scale=scale)
    assert told in str(error.value)


def test_unknown_mapping_is_reported_with_a_suggestion():
    with pytest.raises(UnknownNameError, match="did you mean 'isometric'"):
        MAPPINGS.make("isometrik", {"axes_idx": [0]})
