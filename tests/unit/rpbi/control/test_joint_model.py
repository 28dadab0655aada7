"""Joints and targets for them."""

import math

import pybullet
import pytest

from custom_ros_tools.errors import UnknownNameError
from rpbi.urdf.joints import Joint, JointModel


def _joint(index, name, kind=pybullet.JOINT_REVOLUTE, lower=-1.0, upper=1.0, effort=10.0, velocity=2.0):
    info = (index, name.encode(), kind, 0, 0, 1, 0.0, 0.0, lower, upper, effort, velocity, f"{name}_link".encode())
    return Joint.from_info(info)


MODEL = JointModel([_joint(0, "base", pybullet.JOINT_FIXED), _joint(1, "a"), _joint(2, "b", pybullet.JOINT_PRISMATIC)])


def test_a_target_is_resolved_by_name_whatever_the_order():
    assert MODEL.resolve(["b", "a"], [0.2, 0.1]) == {1: 0.1, 2: 0.2}


def test_a_partial_target_names_only_its_joints():
    assert MODEL.resolve(["b"], [0.2]) == {2: 0.2}


def test_fixed_joints_are_known_but_not_driven():
    assert MODEL.resolve(["base", "a"], [0.0, 0.1]) == {1: 0.1}


def test_an_unknown_joint_is_named_with_the_known_ones():
    with pytest.raises(UnknownNameError, match="unknown joint 'aa'.*base, a, b"):
        MODEL.resolve(["aa"], [0.0])


@pytest.mark.parametrize(
    ("names", "values", "message"),
    [
        (["a", "b"], [0.1], "each of the 2 joints named, got 1"),
        (["a", "a"], [0.1, 0.2], "once each"),
        (["a"], [math.nan], "finite, got nan for joint 'a'"),
        (["a", "b"], [0.0, -math.inf], "finite, got -inf for joint 'b'"),
    ],
)
def test_bad_targets_are_refused_whole(names, values, message):
    with pytest.raises(ValueError, match=message):
        MODEL.resolve(names, values)


def test_no_limits_in_the_description_mean_no_limits():
    joint = _joint(0, "free", lower=0.0, upper=-1.0, effort=0.0, velocity=0.0)
    assert (joint.lower, joint.upper) == (-math.inf, math.inf)
    assert joint.max_effort == joint.max_velocity == math.inf
