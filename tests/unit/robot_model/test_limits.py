"""Positions are brought into limits, by whole turns where that does it; problems narrow the limits of robots."""

import math
import random

import numpy as np
import pytest

from robot_model.limits import TURN, Limits
from rpbi.kinematics import IKProblem

INF = math.inf
NAMES = ("arm", "wrist", "wheel", "slide")
LIMITS = Limits((-3.0, -6.5, -INF, 0.0), (3.0, 6.5, INF, 0.5), (True, True, True, False))


def test_a_joint_that_turns_comes_in_by_whole_turns_and_one_that_slides_at_the_limit():
    limits = Limits((-3.0, -1.0), (3.0, 1.0), (True, False))
    assert limits.wrap_to_limits((2.0 + TURN, 0.5), (0.0, 0.0)) == ([pytest.approx(2.0), 0.5], [False, False])
    assert limits.wrap_to_limits((2.0 - 3 * TURN, 4.0), (0.0, 0.0)) == ([pytest.approx(2.0), 1.0], [False, True])


def test_a_joint_that_fits_in_no_turn_stops_at_the_limit_that_it_is_beyond():
    for position, limit in ((3.1, 3.0), (-3.1, -3.0)):
        inside, stopped = LIMITS.wrap_to_limits((position, 14.0, 0.0, 0.7), (0.0,) * 4)
        assert inside == pytest.approx([limit, 14.0 - 2 * TURN, 0.0, 0.5])
        assert stopped == [True, False, False, True]


def test_a_position_just_beyond_a_limit_comes_to_that_limit_not_to_the_other():
    limits = Limits((-2.967,), (2.967,), (True,))
    for near in (0.0, 2.5, -2.5):
        assert limits.wrap_to_limits((-2.967 - 1e-8,), (near,)) == ([-2.967], [False])
        assert limits.wrap_to_limits((2.967 + 1e-8,), (near,)) == ([2.967], [False])
        assert limits.wrap_to_limits((2.967 + 1e-8 + TURN,), (near,)) == ([2.967], [False])
    assert limits.wrap_to_limits((-2.967 - 0.1,), (0.0,)) == ([-2.967], [True])


def test_of_several_turns_the_nearest_is_taken():
    limits = Limits((-10.0, -INF), (10.0, INF), (True, True))
    q, stopped = limits.wrap_to_limits((0.5, 0.5), (6.0, 100.0))
    assert q[0] == pytest.approx(0.5 + TURN) and abs(q[1] - 100.0) <= math.pi
    assert not any(stopped)


def test_whatever_comes_in_is_within_limits_and_what_is_said_to_be_the_same_pose_is():
    generator = random.Random(1)
    for _ in range(5000):
        lower = generator.uniform(-8.0, 4.0)
        limits = Limits((lower,), (lower + generator.choice((0.0, 1.0, 5.0, 12.0)),), (True,))
        position, near = generator.uniform(-30.0, 30.0), generator.uniform(-30.0, 30.0)
        (inside,), (stopped,) = limits.wrap_to_limits((position,), (near,))
        assert limits.lower[0] <= inside <= limits.upper[0]
        turns = (inside - position) / TURN
        assert stopped == (abs(turns - round(turns)) >= 1e-6)


def test_the_middle_is_within_limits_that_are_open_on_one_side_or_both():
    limits = Limits((-1.0, -INF, 2.0, -INF), (3.0, INF, INF, -2.0), (True,) * 4)
    assert limits.middle == (1.0, 0.0, 2.0, -2.0)


@pytest.mark.parametrize("generator", [random.Random(1), np.random.default_rng(1)], ids=["random", "numpy"])
def test_random_positions_fill_the_limits_and_are_near_where_there_are_none(generator):
    limits = Limits((-1.0, -INF, 2.0), (3.0, INF, INF), (True, True, False))
    first, second, third = zip(*(limits.random(generator, (0.0, 50.0, 0.0)) for _ in range(500)))
    assert -1.0 <= min(first) < -0.9 and 2.9 < max(first) <= 3.0
    assert abs(min(second) - 50.0 + math.pi) < 0.1 and abs(max(second) - 50.0 - math.pi) < 0.1
    assert 2.0 <= min(third) and max(third) <= 3.0


def test_a_search_starts_where_it_is_told_and_then_at_random():
    first, *others = LIMITS.starts([0.1, 0.2, 0.3, 0.4], 3, lambda: random.Random(1))
    assert first == [0.1, 0.2, 0.3, 0.4]
    assert others == [LIMITS.random(generator, first) for generator in [random.Random(1)] for _ in range(3)]


def test_limits_of_a_problem_narrow_those_of_the_robot_and_never_widen_them():
    limits = _narrowed(lower=[-1.0, -9.0, -2.0, 0.1], upper=[9.0, 1.0, 2.0, 0.2])
    assert (limits.lower, limits.upper) == ((-1.0, -6.5, -2.0, 0.1), (3.0, 1.0, 2.0, 0.2))


def test_what_robot_info_tells_of_a_joint_without_limits_means_none():
    limits = _narrowed(lower=[-1.0, -1.0, 0.0, 0.0], upper=[1.0, 1.0, -1.0, 0.5])
    assert (limits.lower[2], limits.upper[2]) == (-INF, INF)


def test_limits_that_leave_a_joint_no_position_are_refused_by_its_name():
    with pytest.raises(ValueError, match="lowerLimits, upperLimits: no position of 'slide' .* URDF has 0 to 0.5"):
        _narrowed(lower=[-1.0, -1.0, -1.0, 0.6], upper=[1.0, 1.0, 1.0, 0.7])


def test_limits_of_some_joints_are_those_of_the_whole():
    some = LIMITS.of([3, 0])
    assert (some.lower, some.upper, some.is_revolute) == ((0.0, -3.0), (0.5, 3.0), (False, True))


def _narrowed(lower, upper):
    rest = {"jointRanges": [1.0] * len(lower), "resetPoses": [0.1] * len(lower)}
    return IKProblem("tool", (0.0, 0.0, 0.0), lowerLimits=lower, upperLimits=upper, **rest).narrowed(LIMITS, NAMES)
