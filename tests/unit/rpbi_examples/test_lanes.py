"""Lanes cover an area: their places, cells, ways, and what is under a tool."""

from __future__ import annotations

import numpy as np
import pytest

from rpbi_examples.scenes.parts.lanes import lanes, middles, ways_along


def test_lanes_are_parallel_and_joined_by_half_circles():
    path = lanes(3, 0.4, 0.1, 0.002)
    assert path[0] == pytest.approx((-0.1, -0.2)) and path[-1] == pytest.approx((0.1, 0.2))
    length = 3 * 0.4 + 2 * np.pi * 0.05
    assert ways_along(path)[-1] == pytest.approx(length, abs=1e-3)
    assert np.diff(ways_along(path)) == pytest.approx(np.full(len(path) - 1, 0.002), rel=0.01)
    assert np.abs(path).max(axis=0) == pytest.approx((0.1, 0.25), abs=1e-3)


def test_one_lane_is_a_line():
    assert lanes(1, 0.4, 0.1, 0.1) == pytest.approx(np.column_stack((np.zeros(5), np.linspace(-0.2, 0.2, 5))))


def test_single_place_has_length_zero():
    assert ways_along([(1.0, 2.0, 3.0)]) == pytest.approx([0.0])


def test_cells_divide_a_rectangle():
    cells = middles((0.4, 0.2), (4, 2))
    assert cells.shape == (4, 2, 2)
    assert cells[0, 0] == pytest.approx((-0.15, -0.05)) and cells[3, 1] == pytest.approx((0.15, 0.05))
