"""Positions of joints are brought into their limits by whole turns where that is the same position."""

import math

import numpy as np
import pybullet
import pytest

from rpbi.kinematics import IKProblem
from rpbi.kinematics.joint_limits import JointLimits
from rpbi.urdf.joints import Joint

TURN = 2.0 * math.pi


def _joint(name, lower, upper, kind=pybullet.JOINT_REVOLUTE):
    return Joint(0, name, kind, f"{name}_link", lower, upper, math.inf, math.inf)


LIMITS = JointLimits(
    [
        _joint("arm", -3.0, 3.0),
        _joint("wrist", -6.5, 6.5),
        _joint("wheel", -math.inf, math.inf),
        _joint("slide", 0.0, 0.5, pybullet.JOINT_PRISMATIC),
    ]
)


def test_a_revolute_joint_beyond_its_limit_comes_back_by_whole_turns():
    inside, stopped = LIMITS.wrap_to_limits(np.array([4.0, 14.0, 0.0, 0.0]), np.zeros(4))
    assert inside[:2] == pytest.approx([4.0 - TURN, 14.0 - 2 * TURN])
    assert not stopped.any()


def test_a_joint_that_fits_in_no_turn_stops_at_its_limit():
    inside, stopped = LIMITS.wrap_to_limits(np.array([3.1, 0.0, 0.0, 0.7]), np.zeros(4))
    assert inside == pytest.approx([3.0, 0.0, 0.0, 0.5])
    assert list(stopped) == [True, False, False, True]


def test_of_several_turns_the_nearest_is_taken():
    near = np.array([0.0, 6.0, 20.0, 0.0])
    inside, _ = LIMITS.wrap_to_limits(np.array([0.0, 0.1, 0.3, 0.0]), near)
    assert inside[1] == pytest.approx(0.1 + TURN)
    assert inside[2] == pytest.approx(0.3 + 3 * TURN)


def test_limits_of_a_problem_narrow_those_of_the_robot_and_never_widen_them():
    limits = LIMITS.narrowed(_problem(lower=[-1.0, -9.0, -2.0, 0.1], upper=[9.0, 1.0, 2.0, 0.2]))
    assert list(limits.lower) == [-1.0, -6.5, -2.0, 0.1]
    assert list(limits.upper) == [3.0, 1.0, 2.0, 0.2]


def test_what_robot_info_tells_of_a_joint_without_limits_means_none():
    limits = LIMITS.narrowed(_problem(lower=[-1.0, -1.0, 0.0, 0.0], upper=[1.0, 1.0, -1.0, 0.5]))
    assert (limits.lower[2], limits.upper[2]) == (-math.inf, math.inf)


def test_limits_that_leave_a_joint_no_position_are_refused_by_its_name():
    with pytest.raises(ValueError, match="lowerLimits, upperLimits: no position of 'slide' .* URDF has 0 to 0.5"):
        LIMITS.narrowed(_problem(lower=[-1.0, -1.0, -1.0, 0.6], upper=[1.0, 1.0, 1.0, 0.7]))


def test_random_positions_are_within_limits_and_near_where_there_are_none():
    near = np.array([0.0, 0.0, 100.0, 0.0])
    drawn = np.array([LIMITS.random(np.random.default_rng(seed), near) for seed in range(100)])
    assert (drawn >= LIMITS.lower).all() and (drawn <= LIMITS.upper).all()
    assert (np.abs(drawn[:, 2] - 100.0) <= math.pi).all()
    assert (np.ptp(drawn, axis=0) > [5.0, 11.0, 5.0, 0.4]).all(), "they fill the range"


def _problem(lower, upper):
    ones = [1.0] * len(lower)
    return IKProblem(
        "tool", (0.0, 0.0, 0.0), lowerLimits=lower, upperLimits=upper, jointRanges=ones, resetPoses=[0.1] * len(lower)
    )
