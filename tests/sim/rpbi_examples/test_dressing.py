"""A sleeve is drawn past a person's elbow, and what the arm feels holds it back."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from custom_ros_tools.config import replace_package
from operator_node.emulators.arm_held_out import ArmHeldOut
from rpbi.world import World
from rpbi_examples.dressing.controller import LARGEST_LEAD_M, Dressing
from rpbi_examples.dressing.force import ARM_SEGMENTS, MeanForce, force_on_arm
from rpbi_examples.dressing.hand import RADIUS_M, ROBOT_BASE
from rpbi_examples.dressing.outcome import AROUND, RINGS, outcome, rings_of
from rpbi_examples.dressing.trial import FORCE_LIMIT_N, WORLD, Trial, run_trial
from rpbi_examples.dressing.way import CUFF, ArmPosition, is_held_out

SHOULDER, ELBOW, WRIST = np.array((0.0, -0.23, 1.43)), np.array((0.32, -0.28, 1.43)), np.array((0.57, -0.27, 1.43))
ARM = ArmPosition(SHOULDER, ELBOW, WRIST)
DT = 0.02
SLEEVE = "{rpbi_examples}/configs/telepresence/sleeve.yaml"


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


def held_cuff(target: Any) -> np.ndarray:
    """Returns where the cuff is whose hand is where it is to be."""
    x, y, z, w = target.quat_xyzw
    to_arm = np.array((2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)))
    return np.array(target.position) + RADIUS_M * to_arm


def test_the_sleeve_goes_back_while_the_arm_feels_too_much_and_on_when_it_does_not():
    dressing, cuff = Dressing(force_limit_n=10.0, speed=0.1), np.array(CUFF)

    def next_x(force_n: float) -> float:
        nonlocal cuff
        cuff = held_cuff(dressing.target(ARM, cuff, force_n, DT))
        return cuff[0]

    for _ in range(200):
        ahead = next_x(0.0)
    slow = next_x(5.0)
    assert ahead - slow == pytest.approx(0.05 * DT, rel=0.1), "half the force that is allowed, half the speed"
    for _ in range(50):
        back = next_x(30.0)
    assert back == pytest.approx(slow + 0.1, abs=0.01), "back, no faster than forth"
    while not dressing.is_done:
        next_x(0.0)
    assert cuff[0] < ELBOW[0]


def test_the_sleeve_waits_for_a_hand_that_does_not_follow():
    dressing, cuff = Dressing(force_limit_n=10.0, speed=0.1), np.array(CUFF)
    for _ in range(500):
        target = dressing.target(ARM, cuff, 0.0, DT)
    assert not dressing.is_done
    assert math.dist(held_cuff(target), cuff) <= LARGEST_LEAD_M + 1e-9, "the hand has never far to go"
    for _ in range(1000):
        cuff = held_cuff(dressing.target(ARM, cuff, 0.0, DT))
    assert dressing.is_done, "when it follows, all goes on"


SNAG_URDF = """<robot name="snag">
  <link name="above"/>
  <joint name="down" type="prismatic">
    <parent link="above"/><child link="plate"/><axis xyz="0 0 -1"/>
    <limit lower="0" upper="0.4" effort="200" velocity="1"/><dynamics damping="5"/>
  </joint>
  <link name="plate">
    <inertial><mass value="0.05"/><inertia ixx="1e-4" ixy="0" ixz="0" iyy="1e-4" iyz="0" izz="1e-4"/></inertial>
    <collision><geometry><box size="0.06 0.2 0.02"/></geometry></collision>
  </link>
</robot>"""
SNAG_PLACE = (0.12, -0.26, 1.6)
SNAG_LIMIT_N, SNAG_STIFFNESS, SNAG_SPEED = 6.0, 200.0, 0.03
CAUGHT_M, TEARS_S = 0.3, 2.0


def pull_against_a_snag(folder: Path, force_limit_n: float) -> tuple[float, float, bool]:
    """Dresses somebody whose arm is pressed by a plate as if the sleeve were caught by a thread, which tears at last.

    The cuff is caught after part of its way, by a spring that draws itself in; the plate presses as hard as that pulls.
    The sleeve itself, which takes time, is left out.

    Returns:
        Largest force on the arm [N], how far the cuff went back until the thread tore [m], and whether it arrived.
    """
    (folder / "snag.urdf").write_text(SNAG_URDF)
    snag = {
        "name": "snag",
        "loadURDF": {"fileName": str(folder / "snag.urdf"), "basePosition": list(SNAG_PLACE), "useFixedBase": True},
        "setJointMotorControlArray": {"controlMode": "TORQUE_CONTROL"},
    }
    (folder / "snag.yaml").write_text(yaml.safe_dump(snag))
    config = yaml.safe_load(Path(replace_package(WORLD)).read_text())
    config["robots"].append(str(folder / "snag.yaml"))
    del config["soft_objects"]
    (folder / "world.yaml").write_text(yaml.safe_dump(config))
    world = World.from_file(str(folder / "world.yaml"))
    dressing = Dressing(force_limit_n, speed=0.3)
    trial = Trial(world, ArmHeldOut(), dressing)
    caught_s, back_m, furthest_m = 0.0, 0.0, 0.0
    while not trial.is_over:
        trial.step()
        drawn_m = CUFF[0] - trial.cuff[0]
        caught_s = caught_s or (trial.time_s if drawn_m > CAUGHT_M else 0.0)
        since_s = trial.time_s - caught_s
        if caught_s and since_s < TEARS_S:
            furthest_m = max(furthest_m, drawn_m)
            back_m = furthest_m - drawn_m
            stretch_m = drawn_m - CAUGHT_M + SNAG_SPEED * since_s
        else:
            stretch_m = 0.0
        world.put("snag/target", {"down": SNAG_STIFFNESS * max(stretch_m, 0.0)})
    world.close()
    return trial.peak_force_n, back_m, dressing.is_done


def test_the_robot_backs_off_from_a_force_on_the_arm_and_goes_on_when_it_ends(tmp_path):
    peak_n, back_m, is_done = pull_against_a_snag(tmp_path, SNAG_LIMIT_N)
    assert back_m > 0.015
    assert 0.8 * SNAG_LIMIT_N < peak_n < 1.5 * SNAG_LIMIT_N
    assert is_done


def test_without_a_limit_the_same_force_grows_beyond_it(tmp_path):
    """The negative control of the test before."""
    peak_n, back_m, is_done = pull_against_a_snag(tmp_path, 1e6)
    assert peak_n > 3.0 * SNAG_LIMIT_N and back_m < 0.005 and is_done


@pytest.mark.parametrize(
    "segments, forces, message",
    (
        (ARM_SEGMENTS[:3], [(0.0, 0.0, 0.0)] * 3, "without RightHand"),
        (ARM_SEGMENTS, [(0.0, 0.0, 0.0)] * 3, "got 4 segments and 3 forces"),
        ((), (), "got none, without RightShoulder"),
        (ARM_SEGMENTS, [(0.0, 0.0, math.nan)] * 4, "expected finite forces on the arm, got"),
    ),
)
def test_forces_that_make_no_sense_are_refused(segments, forces, message):
    with pytest.raises(ValueError, match=message):
        force_on_arm(segments, forces)


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
    found = outcome(rings_of(sleeve_at(np.array(cuff))), ARM, 0.0)
    assert found.is_dressed is is_dressed
    assert found.past_elbow_m == pytest.approx(np.dot(np.array(cuff) - ELBOW, (SHOULDER - ELBOW) / 0.32388), abs=1e-3)


def test_another_mesh_is_no_sleeve():
    with pytest.raises(ValueError, match="expected the 308 triangles of the sleeve, got 2"):
        rings_of(np.zeros((6, 3)))
    with pytest.raises(ValueError, match="expected finite corners"):
        rings_of(np.full((3 * 308, 3), math.inf))


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
    assert robot.link_pose(tip).position == pytest.approx(np.array(CUFF) - (0.0, RADIUS_M, 0.0), abs=2e-3)
    world.close()


def largest_stiffness(mesh: Path, mass: float, step_s: float) -> float:
    """Returns how stiff springs along the edges of a mesh may be [N/m] without damping.

    PyBullet steps them explicitly: the fastest mode of the springs at rest must not turn faster than 2 rad a step.
    """
    lines = [line.split() for line in mesh.read_text().splitlines()]
    corners = np.array([line[1:] for line in lines if line[0] == "v"], dtype=float)
    faces = np.array([line[1:] for line in lines if line[0] == "f"], dtype=int) - 1
    edges = np.unique(np.sort(np.concatenate((faces[:, :2], faces[:, 1:], faces[:, ::2])), axis=1), axis=0)
    along = corners[edges[:, 1]] - corners[edges[:, 0]]
    along /= np.linalg.norm(along, axis=1)[:, None]
    stretch = np.zeros((len(edges), len(corners), 3))
    stretch[np.arange(len(edges)), edges[:, 0]], stretch[np.arange(len(edges)), edges[:, 1]] = -along, along
    fastest = np.linalg.norm(stretch.reshape(len(edges), -1), ord=2) ** 2
    return 4.0 * mass / len(corners) / (fastest * step_s**2)


def test_the_cloth_is_slow_enough_for_the_tick():
    """With 60 N/m it gained energy where it caught on wrist or elbow, and threw the robot's hand off."""
    load = yaml.safe_load(Path(replace_package(SLEEVE)).read_text())["loadSoftBody"]
    step_s = yaml.safe_load(Path(replace_package(WORLD)).read_text())["timeStep"]
    largest = largest_stiffness(Path(replace_package(load["fileName"])), load["mass"], step_s)
    assert load["springElasticStiffness"] <= largest < 60.0
