"""Positions are brought into limits, by whole turns where that does it."""

import math
import random

import pytest

from ik_ros.limits import TURN, Limits

INF = math.inf


def test_a_joint_that_turns_comes_in_by_a_whole_turn_and_one_that_slides_at_the_limit():
    limits = Limits((-3.0, -1.0), (3.0, 1.0), (True, False))
    q, is_same = limits.wrap_to_limits((2.0 + TURN, 0.5), (0.0, 0.0))
    assert (q, is_same) == ([pytest.approx(2.0), 0.5], True)
    q, is_same = limits.wrap_to_limits((2.0 - 3 * TURN, 4.0), (0.0, 0.0))
    assert (q, is_same) == ([pytest.approx(2.0), 1.0], False)


def test_a_position_just_beyond_a_limit_comes_to_that_limit_not_to_the_other():
    limits = Limits((-2.967,), (2.967,), (True,))
    for near in (0.0, 2.5, -2.5):
        assert limits.wrap_to_limits((-2.967 - 1e-8,), (near,)) == ([-2.967], True)
        assert limits.wrap_to_limits((2.967 + 1e-8,), (near,)) == ([2.967], True)
        assert limits.wrap_to_limits((2.967 + 1e-8 + TURN,), (near,)) == ([2.967], True)
    assert limits.wrap_to_limits((-2.967 - 0.1,), (0.0,)) == ([-2.967], False)


def test_of_several_turns_the_nearest_is_taken():
    limits = Limits((-10.0, -INF), (10.0, INF), (True, True))
    q, is_same = limits.wrap_to_limits((0.5, 0.5), (6.0, 100.0))
    assert q[0] == pytest.approx(0.5 + TURN) and abs(q[1] - 100.0) <= math.pi
    assert is_same


def test_whatever_comes_in_is_within_limits_and_what_is_said_to_be_the_same_pose_is():
    generator = random.Random(1)
    for _ in range(5000):
        lower = generator.uniform(-8.0, 4.0)
        limits = Limits((lower,), (lower + generator.choice((0.0, 1.0, 5.0, 12.0)),), (True,))
        position, near = generator.uniform(-30.0, 30.0), generator.uniform(-30.0, 30.0)
        (inside,), is_same = limits.wrap_to_limits((position,), (near,))
        assert limits.lower[0] <= inside <= limits.upper[0]
        turns = (inside - position) / TURN
        assert is_same == (abs(turns - round(turns)) < 1e-6)


def test_the_middle_is_within_limits_that_are_open_on_one_side_or_both():
    limits = Limits((-1.0, -INF, 2.0, -INF), (3.0, INF, INF, -2.0), (True,) * 4)
    assert limits.middle == (1.0, 0.0, 2.0, -2.0)


def test_random_positions_fill_the_limits():
    limits = Limits((-1.0, -INF, 2.0), (3.0, INF, INF), (True, True, False))
    generator = random.Random(1)
    first, second, third = zip(*(limits.random(generator, (0.0, 50.0, 0.0)) for _ in range(500)))
    assert -1.0 <= min(first) < -0.9 and 2.9 < max(first) <= 3.0
    assert abs(min(second) - 50.0 + math.pi) < 0.1 and abs(max(second) - 50.0 - math.pi) < 0.1
    assert 2.0 <= min(third) and max(third) <= 3.0
