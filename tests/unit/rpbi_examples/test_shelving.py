"""Steps that carry a box between two bookcases."""

from __future__ import annotations

import pytest

from robot_model.geometry import rotated
from rpbi_examples.shelving import CLOSED, LEFT, OPEN, RIGHT, carry

BOX = (0.15, 0.56, 0.27)


@pytest.mark.parametrize("bookcase", [LEFT, RIGHT])
def test_hand_points_into_the_bookcase_with_level_fingers(bookcase):
    quat = bookcase.hand_at(BOX).quat_xyzw
    assert rotated(quat, (0.0, 0.0, 1.0)) == pytest.approx((0.0, bookcase.side, 0.0))
    assert rotated(quat, (0.0, 1.0, 0.0))[2] == pytest.approx(0.0)


def test_box_is_held_from_the_grasp_to_the_release():
    steps = carry(BOX, LEFT, RIGHT)
    first, last = steps.index(CLOSED), steps.index(OPEN)
    assert first < last
    for number, step in enumerate(steps):
        if step.pose is not None:
            assert step.held == (first < number < last)
            assert not step.may_touch or step.held


def test_box_goes_to_the_opposite_place():
    steps = carry(BOX, LEFT, RIGHT)
    put = steps[steps.index(OPEN) - 1].pose.position
    assert put == pytest.approx((0.15, -0.56, 0.273)) and RIGHT.has(put) and not LEFT.has(put)
    assert LEFT.has(BOX) and not RIGHT.has(BOX) and not LEFT.has((0.15, 0.56, 0.05)), "one that has fallen"
