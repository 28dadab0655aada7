"""The route that the example's base drives."""

import math

import pytest

from rpbi_examples.motions import ROUTE_GAIN, SQUARE, PlanarPose, Route

DT_S = 0.02


def test_velocities_are_in_the_frame_of_the_base():
    goal = PlanarPose(1.0, 2.0, math.pi / 2.0)
    velocity = Route([goal]).velocity(PlanarPose(1.0, 1.0, math.pi / 2.0))  # looks at the goal
    assert velocity == pytest.approx((ROUTE_GAIN, 0.0, 0.0))
    velocity = Route([goal]).velocity(PlanarPose(1.0, 1.0, 0.0))  # has it to the left
    assert velocity == pytest.approx((0.0, ROUTE_GAIN, ROUTE_GAIN * math.pi / 2.0))


def test_route_turns_in_the_shorter_direction():
    velocity = Route([PlanarPose(0.0, 0.0, -3.0)]).velocity(PlanarPose(0.0, 0.0, 3.0))
    assert velocity.yaw == pytest.approx(ROUTE_GAIN * (2.0 * math.pi - 6.0))


def test_follower_of_the_velocities_passes_all_waypoints_repeatedly():
    route, pose = Route(), PlanarPose(0.0, 0.0, 1.0)
    visits = dict.fromkeys(SQUARE, 0)
    near = None
    for _ in range(round(120.0 / DT_S)):
        ahead, aside, turn = route.velocity(pose)
        cos, sin = math.cos(pose.yaw), math.sin(pose.yaw)
        pose = PlanarPose(
            pose.x + DT_S * (cos * ahead - sin * aside),
            pose.y + DT_S * (sin * ahead + cos * aside),
            pose.yaw + DT_S * turn,
        )
        for goal in SQUARE:
            if math.dist(pose[:2], goal[:2]) < 0.05 and abs(math.remainder(pose.yaw - goal.yaw, 2 * math.pi)) < 0.05:
                visits[goal] += near != goal
                near = goal
    assert min(visits.values()) >= 2
