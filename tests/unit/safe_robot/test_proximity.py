"""Rows of a motion in which something is too near, held against distances that are measured in every row."""

from __future__ import annotations

import numpy as np
import pytest
from guarded_arm import HOME, KUKA

from robot_model.collision.shapes import Obstacle
from robot_model.geometry import Pose
from robot_model.model import RobotModel
from safe_robot.braking import Brake
from safe_robot.checks.proximity import Proximity, _spread_bounds
from safe_robot.checks.proximity_check import link_distances
from safe_robot.motion import CommandedMotion, State

MARGIN_M = 0.02
ROWS = 40
TABLE = Obstacle("table", "box", (0.7, 1.2, 0.1), Pose((-0.7, 0.0, 0.05)))
DOWN = np.array((0.0, 1.3, 0.0, 0.0, 0.0, 0.0, 0.0))
"""To the table from home [rad]."""
PAIRS = [(link, 0) for link in ("lwr_arm_5_link", "lwr_arm_6_link", "end_effector", "end_effector_ball")]


@pytest.fixture(scope="module")
def distances():
    distances = link_distances(RobotModel(KUKA))
    distances.place_obstacles([TABLE])
    return distances


def swing(distances, start, way):
    """Returns a motion that goes some way from rest, and half of it back."""
    share = np.sin(0.75 * np.pi * np.linspace(0.0, 1.0, ROWS)) ** 2
    brake = Brake(share[:, None] * way, *np.zeros((3, ROWS, len(way))))
    return CommandedMotion(distances._robot, State.at_rest(start), start, 0.01, brake)


def least_distance_m(distances, motion) -> float:
    """Returns the smallest distance of any pair in any row."""
    found = []
    for row in motion.position:
        distances.place(row)
        found += [distances.distance(pair, 10.0) for pair in PAIRS]
    return min(found)


def grazing(distances, start, way):
    """Returns two motions along a way, the one just outside the margin and the other just inside it."""
    outside, inside = 0.0, 1.0
    assert least_distance_m(distances, swing(distances, start, way)) < MARGIN_M, "it does not get to the table"
    while inside - outside > 2e-3:
        middle = (outside + inside) / 2.0
        is_outside = least_distance_m(distances, swing(distances, start, middle * way)) >= MARGIN_M
        outside, inside = (middle, inside) if is_outside else (outside, middle)
    return [swing(distances, start, share * way) for share in (outside, inside)]


def test_motion_is_safe_exactly_if_each_row_is(distances):
    """Each pair of motions differs by 0.2 %; planes and distances of the motions before are still in use."""
    proximity = Proximity(distances, PAIRS, MARGIN_M)
    generator = np.random.default_rng(3)
    for _ in range(6):
        start = np.array(HOME) + generator.normal(0.0, 0.1, 7)
        way = DOWN + generator.normal(0.0, 0.1, 7)
        outside, inside = grazing(distances, start, way)
        for is_trial in (False, True):
            outside.is_trial = inside.is_trial = is_trial
            assert proximity.first(outside) is None
            found = proximity.first(inside)
            assert found is not None and found.distance < MARGIN_M and found.is_while_braking


def test_row_without_own_bound_inherits_a_neighbours_minus_the_distance():
    bounds = np.array(((np.inf,), (-np.inf,), (0.5,)))
    _spread_bounds(bounds, np.array((0, 2)), np.array(((0.0,), (0.2,), (0.3,))))
    assert bounds[:, 0] == pytest.approx((np.inf, 0.4, 0.5)), "inf says that a row may be, and nothing of other rows"
