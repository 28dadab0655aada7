"""Attachments hold, break beyond their force, end with their bodies, and are felt by force-torque sensors."""

from __future__ import annotations

import logging
import math
import re

import pytest
from worlds import FLOOR, box, iiwa, write_world

from custom_ros_tools.errors import ConfigError, InterfaceError
from rpbi.config.world import AttachmentConfig
from rpbi.control.external_wrenches import ExternalWrench
from rpbi.control.joint_command import JointCommand
from rpbi.geometry import Pose
from rpbi.samples import WrenchSample
from rpbi.world import World
from rpbi.world.actions import TimedGoal

HAND = "iiwa/lbr_iiwa_link_7"
CARRIED = {"name": "tool", "parent": HAND, "child": "box"}
BENT = {"lbr_iiwa_joint_2": 40.0, "lbr_iiwa_joint_4": -60.0, "lbr_iiwa_joint_6": 30.0}
GHOST = {"name": "ghost", "createVisualShape": {"shapeType": "GEOM_SPHERE", "radius": 0.1}}
START = Pose((0.6, 0.1, 0.6))
WEIGHT_N = 9.81


@pytest.fixture
def build(tmp_path):
    worlds = []

    def make(**main) -> World:
        arm = iiwa(
            initial_joint_position=BENT,
            enabled_joint_force_torque_sensors=["lbr_iiwa_joint_7"],
            joint_state_publisher_hz=1000,
        )
        still = {"linearDamping": 0.0, "angularDamping": 0.0}
        small = {"half_extents_m": (0.03, 0.03, 0.03), "changeDynamics": still}
        held = box(basePosition=list(START.position), **small)
        dynamic = (held, box("other", basePosition=[2.0, 0.0, 0.03], **small))
        path = write_world(tmp_path, visual=(GHOST,), collision=(FLOOR,), dynamic=dynamic, robots=(arm,), **main)
        worlds.append(World.from_file(path))
        return worlds[-1]

    yield make
    for world in worlds:
        world.close()


@pytest.fixture
def world(build):
    return build()


def attach(world, **keys):
    world.attach(AttachmentConfig.parse({**CARRIED, **keys}, "test"))


def run(world, ticks):
    """Returns the last wrench at the wrist."""
    wrench = None
    for _ in range(ticks):
        wrench = next((sample for sample in world.step() if isinstance(sample, WrenchSample)), wrench)
    return wrench


def in_hand(world):
    """Returns where the box is in the hand."""
    robot = world.bodies["iiwa"]
    return robot.link_pose(robot.model["lbr_iiwa_joint_7"].index).inverse() @ world.bodies["box"].base_pose()


def move(world):
    goal = {world.bodies["iiwa"].model["lbr_iiwa_joint_1"].index: 0.5}
    motion = world.act("iiwa", "move", TimedGoal(goal, 0.5))
    while not motion.is_over:
        world.step()


def test_a_fixed_attachment_keeps_the_pose_that_it_had(world):
    before = in_hand(world)
    attach(world)
    move(world)
    run(world, 300)
    after = in_hand(world)
    assert math.dist(before.position, after.position) < 2e-4
    assert abs(sum(a * b for a, b in zip(before.quat_xyzw, after.quat_xyzw))) == pytest.approx(1.0, abs=1e-6)


def test_a_ball_keeps_the_point_alone(world):
    place = {"position": [0.0, 0.0, 0.1]}
    attach(world, kind="ball", parent_pose=place)
    point = in_hand(world).inverse() @ Pose(tuple(place["position"]))
    before = in_hand(world)
    run(world, 700)
    after = in_hand(world)
    assert math.dist((after @ point).position, place["position"]) < 2e-3
    assert abs(sum(a * b for a, b in zip(before.quat_xyzw, after.quat_xyzw))) < 0.99


def test_with_both_poses_they_are_pulled_together(world):
    attach(world, parent_pose={"position": [0.0, 0.0, 0.2]}, child_pose={"position": [0.0, 0.0, -0.03]})
    run(world, 1000)
    assert in_hand(world).position == pytest.approx((0.0, 0.0, 0.23), abs=1e-3)


@pytest.mark.parametrize("swapped", [False, True])
@pytest.mark.parametrize("kind", ["fixed", "ball"])
def test_wrist_sensor_measures_an_attached_load(world, kind, swapped):
    bare = run(world, 300)
    robot = world.bodies["iiwa"]
    hand = robot.link_pose(robot.model["lbr_iiwa_joint_7"].index).position
    below = (hand[0], hand[1], hand[2] - 0.2) if kind == "ball" else START.position
    world.act("box", "teleport", Pose(below))
    parent, child = ("box", HAND) if swapped else (HAND, "box")
    where = "child_pose" if swapped else "parent_pose"
    attach(world, kind=kind, parent=parent, child=child, **{where: {"position": [0.0, 0.0, 0.0]}})
    held = run(world, 1000)
    more = [b - a for a, b in zip((*bare.force, *bare.torque), (*held.force, *held.torque))]
    lever = math.dist(world.bodies["box"].base_pose().position[:2], hand[:2])
    assert math.hypot(*more[:3]) == pytest.approx(WEIGHT_N, rel=1e-3)
    assert math.hypot(*more[3:]) == pytest.approx(WEIGHT_N * lever, rel=5e-3, abs=1e-2)


def test_it_breaks_beyond_its_force_and_not_below(world, caplog):
    attach(world, parent="floor", max_force=WEIGHT_N + 5.0)
    world.act("box", "push", ExternalWrench((0.0, 0.0, -4.5)))
    run(world, 500)
    assert [each.name for each in world.attachments.configs] == ["tool"]
    world.act("box", "push", ExternalWrench((0.0, 0.0, -5.5)))
    run(world, 200)
    assert not world.attachments.configs
    told = [record.message for record in caplog.records if "tool" in record.message]
    assert len(told) == 1 and "attachment 'tool' of 'box' to 'floor' broke at tick" in told[0]
    assert told[0] == world.attachments.last_change
    run(world, 500)
    assert world.bodies["box"].base_pose().position[2] < 0.1


def test_without_a_limit_it_holds_more_than_pybullets_own(world):
    attach(world, parent="floor")
    world.act("box", "push", ExternalWrench((0.0, 0.0, 2000.0)))
    run(world, 500)
    assert world.bodies["box"].base_pose().position[2] < START.position[2] + 0.01


def test_detached_it_falls(world):
    attach(world)
    run(world, 10)
    world.detach("tool")
    run(world, 800)
    assert world.bodies["box"].base_pose().position[2] < 0.1


@pytest.mark.parametrize("gone", ["box", "iiwa"])
def test_removing_a_body_ends_its_attachments_and_says_so_once(world, caplog, gone):
    attach(world)
    with caplog.at_level(logging.INFO):
        world.remove(gone)
        run(world, 5)
    assert not world.attachments.configs
    said = f"attachment 'tool' of 'box' to '{HAND}' ended, since '{gone}' was removed"
    assert [record.message for record in caplog.records if "tool" in record.message] == [said]


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"name": "b", "child": "bx"}, "unknown object 'bx'"),
        ({"name": "b", "parent": "iiwa/hand"}, "unknown link of iiwa 'hand'"),
        ({"name": "again"}, "child: 'box' is attached to 'iiwa/lbr_iiwa_link_7' already, by 'tool'"),
        ({"name": "again", "parent": "box", "child": HAND}, "is attached to 'box' already, by 'tool'"),
        ({"child": "other"}, "name: there is an attachment 'tool' already"),
        ({"name": "b", "parent": "box"}, "child: 'box' cannot be attached to itself"),
        ({"name": "b", "parent": "floor", "child": "iiwa"}, "neither 'iiwa' nor 'floor' can move"),
        ({"name": "b", "child": "ghost"}, "child: 'ghost' is only shown"),
        ({"name": "b", "child": "other", "max_force": -1.0}, "max_force: must be > 0 [N], got -1.0"),
        ({"name": "b", "child": "other", "max_force": math.nan}, "max_force: "),
        ({"name": "b", "child": "other", "max_force": math.inf}, "max_force: "),
        ({"name": "b", "child": "other", "kind": "glue"}, "kind: "),
        ({"name": "", "child": "other"}, "name: "),
        ({"name": "b", "child": "other", "child_pose": {"position": [math.nan, 0.0, 0.0]}}, "child_pose.position"),
        ({"name": "b", "child": "other", "child_pose": {"orientation": [0.0] * 4}}, "child_pose.orientation"),
    ],
)
def test_invalid_attachment_is_refused_without_any_change(world, keys, message):
    attach(world)
    noted, held = world.commands.count, world.attachments.configs
    with pytest.raises((InterfaceError, ValueError), match=re.escape(message)):
        attach(world, **keys)
    assert (world.commands.count, world.attachments.configs) == (noted, held)
    assert world.pb.getNumConstraints() == 1


def maximal(name, x, **more):
    return box(name, basePosition=[x, 2.0, 0.5], useMaximalCoordinates=True, **more)


def test_bodies_in_maximal_coordinates_hold_without_a_limit(tmp_path, capfd):
    bodies = (maximal("one", 0.0), maximal("two", 0.25), box("multi", basePosition=[0.5, 2.0, 0.5]))
    world = World.from_file(write_world(tmp_path, dynamic=bodies))
    for parent, child, more, message in (
        ("one", "two", {"max_force": 5.0}, "max_force: PyBullet does not report the force between two bodies with"),
        ("one", "multi", {}, "use 'multi' as the parent, 'one' as the child"),
    ):
        with pytest.raises(ValueError, match=message):
            attach(world, parent=parent, child=child, **more)
    assert not world.attachments.configs
    attach(world, name="pair", parent="one", child="two")
    attach(world, name="mixed", parent="multi", child="two", kind="ball", max_force=1000.0)
    before = world.bodies["one"].base_pose().inverse() @ world.bodies["two"].base_pose()
    world.put("two/external_wrench", {"force": [0.0, 20.0, 0.0]})
    run(world, 200)
    after = world.bodies["one"].base_pose().inverse() @ world.bodies["two"].base_pose()
    assert [each.name for each in world.attachments.configs] == ["pair", "mixed"]
    assert after.position == pytest.approx(before.position, abs=1e-3)
    world.close()
    assert "failed" not in "".join(capfd.readouterr())


def test_a_name_that_is_not_attached_cannot_be_detached(world):
    with pytest.raises(InterfaceError, match="unknown attachment 'tool': there is none"):
        world.detach("tool")


def test_attached_bodies_cannot_be_teleported(world):
    attach(world)
    for name, what, value in (
        ("box", "teleport", START),
        ("iiwa", "teleport", Pose()),
        ("iiwa", "set_joint_state", JointCommand(["lbr_iiwa_joint_1"], [0.1])),
    ):
        with pytest.raises(ValueError, match=f"'{name}' is held by attachment 'tool', .*; detach it first"):
            world.act(name, what, value)
    world.detach("tool")
    world.act("box", "teleport", START)


def test_reset_restores_exactly_the_attachments_of_the_main_file(build):
    world = build(attachments=[CARRIED])
    start = world.state_hash()
    run(world, 300)
    first = world.state_hash()
    world.detach("tool")
    attach(world, name="another", child="other")
    world.reset()
    assert [each.name for each in world.attachments.configs] == ["tool"]
    assert world.state_hash() == start
    run(world, 300)
    assert world.state_hash() == first
    assert world.pb.getNumConstraints() == 1


def test_attachment_of_an_unknown_object_names_file_and_key(build):
    with pytest.raises(ConfigError, match=r"world.yaml: attachments\[1\]: unknown object 'bx': known are"):
        build(attachments=[CARRIED, {**CARRIED, "name": "b", "child": "bx"}])
