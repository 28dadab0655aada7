"""Values of joints keep to their joints, whatever the order they come in."""

from __future__ import annotations

import math

import numpy as np
import pytest

from custom_ros_tools.joint_values import JointConversion, JointValues, MissingJointsError
from custom_ros_tools.node_configs import RemapConfig


def test_values_follow_their_joints_into_the_order_asked_for() -> None:
    values = JointValues.of(["a", "b", "c"], [1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [7.0, 8.0, 9.0])
    ordered = values.in_order(["c", "a"])
    assert ordered == JointValues(("c", "a"), (3.0, 1.0), (6.0, 4.0), (9.0, 7.0))


def test_missing_joints_are_all_named_and_shift_nothing() -> None:
    """Defect 45: with b missing, the release gave its place to the value of c."""
    with pytest.raises(MissingJointsError) as caught:
        JointValues.of(["a", "c"], [1.0, 3.0]).in_order(["a", "b", "c", "d"])
    assert str(caught.value) == "no values for joints 'b', 'd': it has a, c"
    assert caught.value.names == ("b", "d")


@pytest.mark.parametrize("ns", ["left", "left/"])
def test_namespace_is_used_for_lookup_and_removed_from_the_result(ns: str) -> None:
    values = JointValues.of(["right/a", "left/b", "left/a"], [1.0, 2.0, 3.0])
    assert values.in_order(["a", "b"], ns) == JointValues(("a", "b"), (3.0, 2.0))


def test_joint_missing_in_a_namespace_is_named_with_it() -> None:
    with pytest.raises(MissingJointsError, match="^no values for joint 'left/a': it has a$"):
        JointValues.of(["a"], [1.0]).in_order(["a"], "left")


def test_state_without_names_has_none_of_the_joints() -> None:
    with pytest.raises(MissingJointsError, match="'a': it names none"):
        JointValues.of([], [1.0, 2.0]).in_order(["a"])


def test_quantities_that_are_not_given_stay_so() -> None:
    values = JointValues.of(["a", "b"], velocity=np.array([1.0, 2.0]))
    assert values.in_order(["b", "a"]) == JointValues(("b", "a"), (), (2.0, 1.0), ())


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ((["a", "b"], [1.0]), "expected 2 values of position, one a joint, got 1"),
        ((["a", "b"], [1.0, 2.0], [1.0, 2.0, 3.0]), "expected 2 values of velocity, one a joint, got 3"),
        (([], [1.0, 2.0], [1.0]), "expected 2 values of velocity, one a joint, got 1"),
        ((["a"], [1.0], None, [math.nan]), "values must be finite, got effort nan"),
        ((["a", "b"], [1.0, -math.inf]), "values must be finite, got position 1, -inf"),
        ((["a", "b", "a"], [1.0, 2.0, 3.0]), "joints must be named once each, got a, b, a"),
    ],
)
def test_faulty_values_are_refused_whole(arguments: tuple, told: str) -> None:
    with pytest.raises(ValueError) as caught:
        JointValues.of(*arguments)
    assert str(caught.value) == told


ARM = {
    "joints": [
        {"joint": "a", "rename": "A1", "unit": "deg", "sign": -1, "offset": 90.0},
        {"joint": "c", "rename": "b2", "unit": "mm"},
    ]
}
STATE = JointValues.of(["a", "b", "c"], [0.5, 2.0, 0.03], [0.1, 0.2, 0.3], [1.0, 2.0, 3.0])


def remapping(**keys: object) -> tuple[JointConversion, ...]:
    """Returns what `~config` asks for."""
    return RemapConfig.parse({**ARM, **keys}, "~config").conversions()


def test_joints_are_renamed_and_counted_as_their_driver_does() -> None:
    there = STATE.converted(remapping())
    assert there.names == ("A1", "b", "b2")
    assert there.position == pytest.approx((90.0 - math.degrees(0.5), 2.0, 30.0), rel=1e-15)
    assert there.velocity == pytest.approx((-math.degrees(0.1), 0.2, 300.0), rel=1e-15), "an offset moves nothing"
    assert there.effort == (-1.0, 2.0, 3.0)


def test_there_and_back_is_the_identity() -> None:
    back = STATE.converted(remapping()).converted(remapping(inverse=True))
    assert back.names == STATE.names
    for quantity in ("position", "velocity", "effort"):
        assert getattr(back, quantity) == pytest.approx(getattr(STATE, quantity), rel=1e-14)
    wrong = STATE.converted(remapping()).converted(remapping(inverse=True, joints=[ARM["joints"][1]]))
    assert wrong.names != STATE.names


def test_joints_that_are_not_handed_on_need_not_be_there() -> None:
    conversions = remapping(joint_names=["c"])
    assert STATE.in_order(["c"]).converted(conversions).position == (30.0,)


def test_joint_that_is_to_be_converted_and_missing_is_named() -> None:
    with pytest.raises(MissingJointsError, match="^no values for joint 'c': it has a$"):
        JointValues.of(["a"], [1.0]).converted(remapping())


def test_name_that_another_joint_has_already_is_refused() -> None:
    with pytest.raises(ValueError, match="named once each"):
        JointValues.of(["a", "b"], [1.0, 2.0]).converted([JointConversion("a", "b")])
