"""A sleeve is drawn past a person's elbow, and what the arm feels holds it back."""

from __future__ import annotations

import numpy as np
import pytest

from custom_ros_tools.config import replace_package
from rpbi.world import World
from rpbi_examples.dressing import (
    AROUND,
    CUFF,
    RINGS,
    ROBOT_BASE,
    ArmPosition,
    Dressing,
    MeanForce,
    is_held_out,
    outcome,
    rings_of,
)
from rpbi_examples.dressing_trial import FORCE_LIMIT_N, WORLD, run_trial

SHOULDER, ELBOW, WRIST = np.array((0.0, -0.23, 1.43)), np.array((0.32, -0.28, 1.43)), np.array((0.57, -0.27, 1.43))
ARM = ArmPosition(SHOULDER, ELBOW, WRIST)
DT = 0.02


def sleeve_at(cuff: np.ndarray) -> np.ndarray:
    """Returns the corners of the triangles of the shipped sleeve, with the middle of its cuff somewhere."""
    lines = open(replace_package("{rpbi_examples}/configs/meshes/sleeve.obj")).read().splitlines()
    corners = np.array([line.split()[1:] for line in lines if line.startswith("v ")], dtype=float)
    faces = np.array([line.split()[1:] for line in lines if line.startswith("f ")], dtype=int) - 1
    return (corners + cuff)[faces].reshape(-1, 3)


def test_a_person_of_chance_is_dressed():
    """Faster than people would like, so that the test is short; `./rpbi bench dressing` has 20 of them."""
    found = run_trial(0, speed=0.3)
    assert found.is_dressed and found.past_elbow_m == pytest.approx(0.1, abs=0.02)
    assert 0.0 < found.peak_force_n < FORCE_LIMIT_N


def test_the_sleeve_goes_back_while_the_arm_feels_too_much_and_on_when_it_does_not():
    dressing = Dressing(force_limit_n=10.0, speed=0.1)
    for _ in range(200):
        target = dressing.target(ARM, 0.0, DT)
    ahead = target.position[0]
    slow = dressing.target(ARM, 5.0, DT).position[0]
    assert ahead - slow == pytest.approx(0.05 * DT, rel=0.1), "half the force that is allowed, half the speed"
    for _ in range(50):
        target = dressing.target(ARM, 30.0, DT)
    assert target.position[0] == pytest.approx(slow + 0.1, abs=0.01), "back, no faster than forth"
    while not dressing.is_done:
        target = dressing.target(ARM, 0.0, DT)
    assert target.position[0] < ELBOW[0]


def test_force_is_the_mean_of_a_tenth_of_a_second():
    force = MeanForce()
    assert force.add(0.0, (3.0, 4.0, 0.0)) == 5.0
    assert force.add(0.05, (-3.0, -4.0, 0.0)) == 0.0
    assert force.add(0.12, (0.0, 0.0, 2.0)) == pytest.approx(np.linalg.norm((-1.5, -2.0, 1.0)))
    assert force.peak_n == 5.0


@pytest.mark.parametrize(
    "cuff, is_dressed",
    (
        ((0.22, -0.265, 1.43), True),
        ((0.30, -0.28, 1.43), False),  # not far enough
        ((0.22, -0.265, 1.60), False),  # above the arm
        (CUFF, False),
    ),
)
def test_outcome_tells_whether_the_arm_is_in_the_sleeve(cuff, is_dressed):
    found = outcome(sleeve_at(np.array(cuff)), ARM, 0.0)
    assert found.is_dressed is is_dressed
    assert found.past_elbow_m == pytest.approx(np.dot(np.array(cuff) - ELBOW, (SHOULDER - ELBOW) / 0.32388), abs=1e-3)


def test_another_mesh_is_no_sleeve():
    with pytest.raises(ValueError, match="expected the 308 triangles of the sleeve, got 2"):
        rings_of(np.zeros((6, 3)))


def test_an_arm_that_hangs_is_not_held_out():
    assert is_held_out(ARM)
    down = ArmPosition(SHOULDER, SHOULDER - (0.0, 0.0, 0.3), SHOULDER - (0.0, 0.0, 0.55))
    assert not is_held_out(down)


def test_the_world_is_what_the_code_takes_it_for():
    world = World.from_file(WORLD)
    assert world.bodies["panda"].base_pose().position == pytest.approx(ROBOT_BASE.position)
    nodes = np.array(world.bodies["sleeve"].state().nodes)
    assert len(nodes) == AROUND * RINGS and nodes[:AROUND].mean(axis=0) == pytest.approx(CUFF, abs=1e-6)
    robot = world.bodies["panda"]
    tip = next(i for i in range(len(robot.joint_indices)) if robot.link_name(i) == "panda_grasptarget")
    assert robot.link_pose(tip).position == pytest.approx(np.array(CUFF) - (0.0, 0.085, 0.0), abs=2e-3)
    world.close()
