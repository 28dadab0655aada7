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


def test_revolute_joint_wraps_by_whole_turns_and_prismatic_is_clamped():
    limits = Limits((-3.0, -1.0), (3.0, 1.0), (True, False))
    assert limits.wrap_to_limits((2.0 + TURN, 0.5), (0.0, 0.0)) == ([pytest.approx(2.0), 0.5], [False, False])
    assert limits.wrap_to_limits((2.0 - 3 * TURN, 4.0), (0.0, 0.0)) == ([pytest.approx(2.0), 1.0], [False, True])


def test_joint_that_cannot_wrap_inside_stops_at_the_exceeded_limit():
    for position, limit in ((3.1, 3.0), (-3.1, -3.0)):
        inside, stopped = LIMITS.wrap_to_limits((position, 14.0, 0.0, 0.7), (0.0,) * 4)
        assert inside == pytest.approx([limit, 14.0 - 2 * TURN, 0.0, 0.5])
        assert stopped == [True, False, False, True]


def test_position_slightly_outside_a_limit_comes_to_that_limit():
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


def test_wrapped_positions_are_within_limits_and_correctly_flagged():
    generator = random.Random(1)
    for _ in range(5000):
        lower = generator.uniform(-8.0, 4.0)
        limits = Limits((lower,), (lower + generator.choice((0.0, 1.0, 5.0, 12.0)),), (True,))
        position, near = generator.uniform(-30.0, 30.0), generator.uniform(-30.0, 30.0)
        (inside,), (stopped,) = limits.wrap_to_limits((position,), (near,))
        assert limits.lower[0] <= inside <= limits.upper[0]
        turns = (inside - position) / TURN
        assert stopped == (abs(turns - round(turns)) >= 1e-6)


def test_middle_is_finite_for_limits_open_on_any_side():
    limits = Limits((-1.0, -INF, 2.0, -INF), (3.0, INF, INF, -2.0), (True,) * 4)
    assert limits.middle == (1.0, 0.0, 2.0, -2.0)


@pytest.mark.parametrize("generator", [random.Random(1), np.random.default_rng(1)], ids=["random", "numpy"])
def test_random_positions_fill_limits_or_stay_near_without_limits(generator):
    limits = Limits((-1.0, -INF, 2.0), (3.0, INF, INF), (True, True, False))
    first, second, third = zip(*(limits.random(generator, (0.0, 50.0, 0.0)) for _ in range(500)))
    assert -1.0 <= min(first) < -0.9 and 2.9 < max(first) <= 3.0
    assert abs(min(second) - 50.0 + math.pi) < 0.1 and abs(max(second) - 50.0 - math.pi) < 0.1
    assert 2.0 <= min(third) and max(third) <= 3.0


def test_search_begins_at_the_given_start_then_at_random():
    first, *others = LIMITS.starts([0.1, 0.2, 0.3, 0.4], 3, lambda: random.Random(1))
    assert first == [0.1, 0.2, 0.3, 0.4]
    assert others == [LIMITS.random(generator, first) for generator in [random.Random(1)] for _ in range(3)]


def test_problem_limits_narrow_those_of_the_robot_only():
    limits = _narrowed(lower=[-1.0, -9.0, -2.0, 0.1], upper=[9.0, 1.0, 2.0, 0.2])
    assert (limits.lower, limits.upper) == ((-1.0, -6.5, -2.0, 0.1), (3.0, 1.0, 2.0, 0.2))


def test_robot_info_limits_of_an_unlimited_joint_mean_none():
    limits = _narrowed(lower=[-1.0, -1.0, 0.0, 0.0], upper=[1.0, 1.0, -1.0, 0.5])
    assert (limits.lower[2], limits.upper[2]) == (-INF, INF)


def test_limits_without_any_valid_position_are_refused_by_joint_name():
    with pytest.raises(ValueError, match="lowerLimits, upperLimits: no position of 'slide' .* URDF has 0 to 0.5"):
        _narrowed(lower=[-1.0, -1.0, -1.0, 0.6], upper=[1.0, 1.0, 1.0, 0.7])


def test_limits_of_some_joints_are_those_of_the_whole():
    some = LIMITS.of([3, 0])
    assert (some.lower, some.upper, some.is_revolute) == ((0.0, -3.0), (0.5, 3.0), (False, True))


def _narrowed(lower, upper):
    rest = {"jointRanges": [1.0] * len(lower), "resetPoses": [0.1] * len(lower)}
    return IKProblem("tool", (0.0, 0.0, 0.0), lowerLimits=lower, upperLimits=upper, **rest).narrowed(LIMITS, NAMES)
