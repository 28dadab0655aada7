"""Parts of the whole-body controller: wrenches of a sole, the way of a hand, tasks."""

from __future__ import annotations

from itertools import product
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("pinocchio")
pytest.importorskip("daqp")

from robot_model.geometry import Pose, quaternion_of
from rpbi_examples.balance.dynamics import FrameMotion
from rpbi_examples.balance.largest_push import DIRECTIONS, draw, pushes_in
from rpbi_examples.balance.program import wrench_cone
from rpbi_examples.balance.tasks import Approach, capture

LENGTH, WIDTH, FRICTION = 0.1, 0.05, 0.6
CORNERS = [(x * LENGTH, y * WIDTH, 0.0) for x, y in product((1.0, -1.0), repeat=2)]


def wrench(forces) -> np.ndarray:
    """Returns force and torque of forces on the corners, shape (4, 3)."""
    return np.concatenate((forces.sum(axis=0), np.cross(CORNERS, forces).sum(axis=0)))


def corner_forces(random, share: float) -> np.ndarray:
    """Returns forces on the corners whose friction is a share of that of the pyramid."""
    up = random.uniform(0.0, 100.0, 4)
    across = random.uniform(-1.0, 1.0, (4, 2)) * up[:, None] * share * FRICTION / np.sqrt(2.0)
    return np.column_stack((across, up))


def test_wrenches_that_corner_forces_can_produce_are_in_the_cone():
    random, cone = np.random.default_rng(1), wrench_cone(LENGTH, WIDTH, FRICTION)
    for _ in range(300):
        assert (cone @ wrench(corner_forces(random, 1.0)) <= 1e-9).all()


@pytest.mark.parametrize(
    "outside",
    [
        (45.0, 0.0, 100.0, 0.0, 0.0, 0.0),  # slides
        (0.0, 0.0, -1.0, 0.0, 0.0, 0.0),  # is pulled
        (0.0, 0.0, 100.0, 5.1, 0.0, 0.0),  # tips sideways
        (0.0, 0.0, 100.0, 0.0, -10.1, 0.0),  # tips backwards
        (0.0, 0.0, 100.0, 0.0, 0.0, 6.5),  # turns
    ],
)
def test_other_wrenches_are_outside_the_cone(outside):
    assert (wrench_cone(LENGTH, WIDTH, FRICTION) @ outside > 0.0).any()


def test_a_hand_comes_to_its_target_without_haste():
    way = Approach(np.zeros(3), np.eye(3), 0.004, 0.5)
    target = Pose((0.6, 0.0, 0.3), quaternion_of((0.0, 1.0, 0.0)))
    speeds = []
    for _ in range(1000):
        way.advance(target, way.position, way.turn)
        speeds.append(np.linalg.norm(way.velocity))
    assert way.position == pytest.approx(target.position, abs=1e-4)
    assert way.turn[0, 2] == pytest.approx(np.sin(1.0), abs=1e-4)
    assert 0.4 < max(speeds) <= 0.5


def test_approach_waits_for_a_hand_that_is_held():
    way = Approach(np.zeros(3), np.eye(3), 0.004, 0.5)
    for _ in range(1000):
        way.advance(Pose((0.6, 0.0, 0.3), quaternion_of((0.0, 1.0, 0.0))), np.zeros(3), np.eye(3))
    assert np.linalg.norm(way.position) <= 0.05 + 1e-9
    assert np.arcsin(way.turn[0, 2]) == pytest.approx(0.3)


def test_the_capture_point_comes_to_its_goal():
    """A point mass that moves as wanted: from 5 cm off, with a speed that would carry it away."""
    centre, velocity = np.array((0.05, 0.0, 0.9)), np.array((0.2, -0.1, 0.0))
    for _ in range(3000):
        motion = FrameMotion(np.eye(3), velocity, np.zeros(3))
        task = capture(motion, centre, np.zeros(2), 0.9, 3.0, 1.0)
        velocity = velocity + 0.001 * np.array((*task.wanted, 0.0))
        centre = centre + 0.001 * velocity
    assert centre[:2] == pytest.approx((0.0, 0.0), abs=1e-3)


def test_pushes_are_drawn_from_the_table_of_the_docs(tmp_path):
    text = (Path(__file__).resolve().parents[3] / "docs/example_talos.md").read_text()
    pushes = pushes_in(text)
    assert pushes.keys() == set(DIRECTIONS) and min(pushes.values()) >= 10.0, "as large as in the scene"
    draw(pushes, tmp_path / "pushes.png")
    assert (tmp_path / "pushes.png").stat().st_size > 10_000
    with pytest.raises(ValueError, match="'| back | N s |'"):
        pushes_in(text.replace("| back |", "| behind |"))
