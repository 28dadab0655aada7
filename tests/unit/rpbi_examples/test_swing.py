"""The motion of the example robots."""

import math

import numpy as np
import pytest

from rpbi_examples.motions import SWING_PERIOD_S, TO_ZERO_S, Swing

START = (0.3, -1.2, 0.0)
LOWER = (-2.0, -0.5, -math.inf)
UPPER = (2.0, 2.0, math.inf)


@pytest.fixture
def swing():
    return Swing(START, LOWER, UPPER)


def test_it_starts_where_the_robot_is_and_comes_to_zero(swing):
    assert swing.at(0.0) == START
    assert swing.at(TO_ZERO_S) == (0.0, 0.0, 0.0)


def test_one_joint_moves_at_a_time_forth_and_back(swing):
    moved = []
    for turn in range(8):
        positions = swing.at(TO_ZERO_S + (turn + 0.25) * SWING_PERIOD_S)
        moved += [joint for joint, position in enumerate(positions) if position]
    assert moved == [0, 1, 2, 1, 0, 1, 2, 1]


def test_no_joint_ever_leaves_its_limits(swing):
    for time_s in np.arange(TO_ZERO_S, TO_ZERO_S + 8 * SWING_PERIOD_S, 0.05):
        assert all(low <= position <= high for low, position, high in zip(LOWER, swing.at(time_s), UPPER))


def test_a_joint_whose_limits_leave_out_zero_goes_to_the_nearest_it_may():
    assert Swing((1.0,), (0.5,), (2.0,)).at(TO_ZERO_S) == (0.5,)
