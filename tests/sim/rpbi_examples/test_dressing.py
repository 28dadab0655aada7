"""A sleeve is drawn past a person's elbow, and what the arm feels holds it back."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
import yaml

from custom_ros_tools.config import replace_package
from operator_node.avatar.segment_forces import SegmentForce, forces_by_segment
from operator_node.emulators.arm_held_out import RAISING_S, ArmHeldOut
from operator_node.mvn.segments import SEGMENTS
from rpbi.world import World
from rpbi_examples.dressing.cuff_path import CUFF, ArmPosition, is_held_out
from rpbi_examples.dressing.hand import MAX_LEAD_M, RADIUS_M, ROBOT_BASE, Dressing
from rpbi_examples.dressing.outcome import ARM_SEGMENTS, AROUND, RINGS, ArmForce, forces_on_arm, outcome, rings_of
from rpbi_examples.dressing.trial import FORCE_LIMIT_N, MAX_DURATION_S, WORLD, Trial, run_trial

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


@pytest.mark.thorough
def test_a_person_of_chance_is_dressed():
    """Faster than people would like, so that the test is short; `./rpbi bench dressing` has 20 of them."""
    found = run_trial(0, speed=0.3)
    assert found.is_dressed and found.past_elbow_m == pytest.approx(0.1, abs=0.02)
    assert 0.0 < found.peak_force_n < FORCE_LIMIT_N and found.is_within_limits


def held_cuff(target: Any) -> np.ndarray:
    """Returns where the cuff is whose hand is where it is to be."""
    x, y, z, w = target.quat_xyzw
    to_arm = np.array((2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)))
    return np.array(target.position) + RADIUS_M * to_arm


def test_sleeve_retreats_from_a_large_force_and_advances_again():
    dressing, cuff = Dressing(speed=0.1), np.array(CUFF)

    def next_x(force_share: float) -> float:
        nonlocal cuff
        cuff = held_cuff(dressing.target(ARM, cuff, force_share, DT))
        return cuff[0]

    for _ in range(200):
        ahead = next_x(0.0)
    slow = next_x(0.5)
    assert ahead - slow == pytest.approx(0.05 * DT, rel=0.1), "half the force that is allowed, half the speed"
    for _ in range(50):
        back = next_x(3.0)
    assert back == pytest.approx(slow + 0.1, abs=0.01), "back, no faster than forth"
    while not dressing.is_done:
        next_x(0.0)
    assert cuff[0] < ELBOW[0]


def test_the_sleeve_waits_for_a_hand_that_does_not_follow():
    dressing, cuff = Dressing(speed=0.1), np.array(CUFF)
    for _ in range(500):
        target = dressing.target(ARM, cuff, 0.0, DT)
    assert not dressing.is_done
    assert math.dist(held_cuff(target), cuff) <= MAX_LEAD_M + 1e-9, "the hand has never far to go"
    for _ in range(1000):
        cuff = held_cuff(dressing.target(ARM, cuff, 0.0, DT))
    assert dressing.is_done, "when it follows, all goes on"


PLATE_URDF = """<robot name="plate">
  <link name="rail"/>
  <joint name="push" type="prismatic">
    <parent link="rail"/><child link="plate"/><axis xyz="0 0 -1"/>
    <limit lower="0" upper="0.4" effort="200" velocity="1"/><dynamics damping="5"/>
  </joint>
  <link name="plate">
    <inertial><mass value="0.05"/><inertia ixx="1e-4" ixy="0" ixz="0" iyy="1e-4" iyz="0" izz="1e-4"/></inertial>
    <collision><geometry><box size="0.06 0.2 0.02"/></geometry></collision>
  </link>
</robot>"""
ABOVE = (0.12, -0.26, 1.6), 0.0
LEFT, RIGHT = ((0.2, -0.1, 1.43), -math.pi / 2), ((0.2, -0.43, 1.43), math.pi / 2)
"""Position [m] and roll [rad] of plates that are pushed onto the upper arm."""
SNAG_LIMIT_N, SNAG_STIFFNESS, SNAG_SPEED = 6.0, 200.0, 0.03
CAUGHT_M, TEARS_S = 0.3, 2.0
SQUEEZE_N = 40.0


class Pressed(NamedTuple):
    """Somebody is dressed while plates press on their arm.

    Attributes:
        peak_n: Largest force on the arm [N].
        back_m: How far the cuff went back until the plates let go [m].
        is_done: Whether the cuff arrived.
        net_n: Magnitude of the vector sum of forces when the plates press, as median [N].
    """

    peak_n: float
    back_m: float
    is_done: bool
    net_n: float


def dress_pressed(
    folder: Path,
    force_limit_n: float,
    plates: Sequence[tuple[Sequence[float], float]],
    push_n: Callable[[float, float], float],
    longest_s: float = MAX_DURATION_S,
) -> Pressed:
    """Dresses somebody on whose arm plates press, from when the cuff has been drawn 0.3 m and for 2 s.

    The sleeve itself, which takes time, is left out.

    Args:
        folder: Where the world is written.
        force_limit_n: Largest force on the arm [N].
        plates: Position [m] and roll [rad] of each plate.
        push_n: Force of each plate [N], some time after they began [s], with the cuff so far beyond that place [m].
        longest_s: When to end in any case, after plates began to press [s].
    """
    (folder / "plate.urdf").write_text(PLATE_URDF)
    config = yaml.safe_load(Path(replace_package(WORLD)).read_text())
    for number, (position, roll) in enumerate(plates):
        load = {"fileName": str(folder / "plate.urdf"), "basePosition": list(position), "useFixedBase": True}
        plate = {
            "name": f"plate_{number}",
            "loadURDF": {**load, "baseOrientation": [math.sin(roll / 2), 0.0, 0.0, math.cos(roll / 2)]},
            "setJointMotorControlArray": {"controlMode": "TORQUE_CONTROL"},
        }
        (folder / f"plate_{number}.yaml").write_text(yaml.safe_dump(plate))
        config["robots"].append(str(folder / f"plate_{number}.yaml"))
    del config["soft_objects"]
    (folder / "world.yaml").write_text(yaml.safe_dump(config))
    world = World.from_file(str(folder / "world.yaml"))
    dressing = Dressing(speed=0.3)
    trial = Trial(world, ArmHeldOut(), dressing, force_limit_n)
    caught_s, back_m, furthest_m = 0.0, 0.0, 0.0
    nets_n = []
    since_s = 0.0
    while not trial.is_over and since_s < longest_s:
        trial.step()
        drawn_m = CUFF[0] - trial.cuff[0]
        caught_s = caught_s or (trial.time_s if drawn_m > CAUGHT_M else 0.0)
        since_s = trial.time_s - caught_s if caught_s else 0.0
        force_n = 0.0
        if caught_s and since_s < TEARS_S:
            furthest_m = max(furthest_m, drawn_m)
            back_m = furthest_m - drawn_m
            force_n = push_n(since_s, drawn_m - CAUGHT_M)
            nets_n.append(math.hypot(*world.contacts.sample(world.bodies["human"], world.clock.tick).force))
        for number in range(len(plates)):
            world.put(f"plate_{number}/target", {"push": force_n})
    world.close()
    return Pressed(trial.force.peak_n, back_m, dressing.is_done, float(np.median(nets_n)))


def as_a_thread(since_s: float, beyond_m: float) -> float:
    """Returns the force of a thread that caught the sleeve and draws itself in [N]."""
    return SNAG_STIFFNESS * max(beyond_m + SNAG_SPEED * since_s, 0.0)


def as_a_squeeze(since_s: float, beyond_m: float) -> float:
    return SQUEEZE_N


@pytest.mark.thorough
def test_robot_backs_off_from_a_force_and_continues_afterwards(tmp_path):
    found = dress_pressed(tmp_path, SNAG_LIMIT_N, [ABOVE], as_a_thread)
    assert found.back_m > 0.015
    assert 0.8 * SNAG_LIMIT_N < found.peak_n < 1.5 * SNAG_LIMIT_N
    assert found.is_done


@pytest.mark.thorough
def test_without_a_limit_the_same_force_grows_beyond_it(tmp_path):
    """The negative control of the test before."""
    found = dress_pressed(tmp_path, 1e6, [ABOVE], as_a_thread)
    assert found.peak_n > 3.0 * SNAG_LIMIT_N and found.back_m < 0.005 and found.is_done


@pytest.mark.thorough
@pytest.mark.parametrize(
    "limit_n, backs_off", ((FORCE_LIMIT_N, True), pytest.param(1e6, False, marks=pytest.mark.thorough))
)
def test_squeeze_from_both_sides_is_detected_although_its_vectors_cancel(tmp_path, limit_n, backs_off):
    """With a limit beyond all, its negative control, the robot goes on as with a sum of vectors."""
    found = dress_pressed(tmp_path, limit_n, [LEFT, RIGHT], as_a_squeeze, longest_s=0.6)
    assert found.net_n < 0.3 * FORCE_LIMIT_N, "as vectors the two would not even slow the robot down"
    assert found.peak_n == pytest.approx(2 * SQUEEZE_N, rel=0.25)
    assert bool(found.back_m > 0.1) is backs_off


@pytest.mark.parametrize(
    "segments, sums, largest, message",
    (
        (ARM_SEGMENTS[:3], [0.0] * 3, [0.0] * 3, "without RightHand"),
        (ARM_SEGMENTS, [0.0] * 3, [0.0] * 4, "got 4 segments, 3 sums and 4 largest forces"),
        ((), (), (), "got none, without RightShoulder"),
        (ARM_SEGMENTS, [math.nan] * 4, [0.0] * 4, "RightShoulder: expected finite forces .*, got nan and 0 N"),
        (ARM_SEGMENTS, [1.0] * 4, [1.0, -2.0, 1.0, 1.0], "RightUpperArm: expected finite forces .*, got 1 and -2 N"),
    ),
)
def test_forces_that_make_no_sense_are_refused(segments, sums, largest, message):
    with pytest.raises(ValueError, match=message):
        forces_on_arm(segments, sums, largest)


def arm_forces(contacts: Sequence[tuple[str, Sequence[float]]]) -> dict[str, SegmentForce]:
    return forces_by_segment(ARM_SEGMENTS, contacts)


def test_force_is_the_mean_of_a_tenth_of_a_second():
    force = ArmForce(FORCE_LIMIT_N)
    arm = []
    for time_s, sum_n in ((0.0, 5.0), (0.05, 7.0), (0.12, 2.0)):
        force.add(time_s, arm_forces([("RightHand", (0.0, sum_n, 0.0)), ("Head", (9.0, 0.0, 0.0))]))
        arm.append(force.arm_n)
    assert arm == [5.0, 6.0, 4.5]
    assert force.peak_n == 6.0 and force.peak_share == 6.0 / FORCE_LIMIT_N


def test_contacts_segments_and_arm_have_separate_limits():
    def shares(*contacts) -> list[float]:
        """Returns shares of limits at the first tick, and after many without contacts among them."""
        force, found = ArmForce(400.0), []
        for tick in range(20):
            force.add(0.004 * tick, arm_forces(contacts if tick == 0 else ()))
            found.append(force.share)
        return [found[0], found[-1]]

    first, last = shares(("RightHand", (0.0, 0.0, 210.0)))
    assert (first, last) == (210.0 / 140.0, 210.0 / 280.0), "quasi-static as long as it lasts, else transient"
    first, _ = shares(*[("RightForeArm", (0.0, side * 40.0, 0.0)) for side in (-1, 1)])
    assert first == 80.0 / 160.0, "both sides of a segment"
    first, _ = shares(*[(segment, (0.0, 0.0, 110.0)) for segment in ARM_SEGMENTS])
    assert first == 440.0 / 400.0, "no segment is beyond its limit, the arm is"


def test_raised_arm_avoids_the_robot_at_the_side():
    """Raised to the side, the hand of seed 25 met the robot's arm with 72 N before anything was drawn."""
    for t_pose_s in (0.0, 1.0):
        person = ArmHeldOut(1.6021, 25, t_pose_s=t_pose_s)
        frames = [person.frame(t_pose_s + RAISING_S * k / 60) for k in range(20, 61)]
        assert min(frame.positions[SEGMENTS.index("RightHand"), 1] for frame in frames) > ROBOT_BASE.position[1] + 0.35


@pytest.mark.parametrize(
    "cuff, is_dressed",
    (
        ((0.22, -0.265, 1.43), True),
        ((0.30, -0.28, 1.43), False),  # not far enough
        ((0.22, -0.265, 1.60), False),  # above the arm
        (CUFF, False),
    ),
)
def test_outcome_is_dressed_exactly_if_the_arm_is_inside(cuff, is_dressed):
    found = outcome(rings_of(sleeve_at(np.array(cuff))), ARM, ArmForce(FORCE_LIMIT_N))
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


def test_world_matches_the_constants_of_the_code():
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
