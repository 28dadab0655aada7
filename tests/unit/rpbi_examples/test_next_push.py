"""Where an arm pushes a box to bring it to a place."""

import math

import pytest

from rpbi_examples.motions import PlanarPose
from rpbi_examples.pushing import BALL_RADIUS_M, HALF_SIDES_M, next_push


@pytest.mark.parametrize("turns", range(-2, 3))
def test_ball_pushes_the_middle_of_the_side_away_from_goal(turns):
    push = next_push(PlanarPose(0.5, 0.1, turns * math.pi / 2.0), (0.5, 0.4))
    back = HALF_SIDES_M[(turns + 1) % 2] + BALL_RADIUS_M
    assert push.start == pytest.approx((0.5, 0.1 - back))
    assert push.end == pytest.approx((0.5, 0.4 - back))
    assert push.beside(0.04) == pytest.approx((0.5, 0.06 - back))
    assert push.beside(-0.3) == pytest.approx(push.end)


def test_tilted_box_approaches_the_goal_with_each_push():
    box, goal, pushes = PlanarPose(0.0, 0.0, 0.2), (0.3, 0.2), 0
    while (push := next_push(box, goal)) is not None:
        before = math.dist((box.x, box.y), goal)
        x, y = (at + end - start for at, start, end in zip((box.x, box.y), push.start, push.end))
        box, pushes = box._replace(x=x, y=y), pushes + 1
        assert math.dist((box.x, box.y), goal) < before - 0.05
    assert pushes == 2 and math.dist((box.x, box.y), goal) < 0.05


def test_a_box_that_is_there_is_left_alone():
    assert next_push(PlanarPose(0.5, 0.1, 0.3), (0.51, 0.1)) is None
