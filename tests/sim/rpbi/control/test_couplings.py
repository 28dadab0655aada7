"""Joints that follow others: they do, in every mode, and what a gripper holds stays where it is."""

from __future__ import annotations

import logging
import math

import pytest
from gripper import gripper
from worlds import box, write_world

from custom_ros_tools.errors import ConfigError
from rpbi.control.joint_command import JointCommand
from rpbi.world import World
from rpbi.world.actions import TimedGoal

LEFT, RIGHT = 0, 1
HALVES = {"coupled_joints": {"right": {"joint": "left", "multiplier": 0.5, "offset": 0.01}}}


@pytest.fixture
def build(tmp_path):
    worlds = []

    def make(dynamic=(), mimic='<mimic joint="left"/>', main=None, **more) -> World:
        robots = (gripper(tmp_path, mimic, **more),)
        worlds.append(World.from_file(write_world(tmp_path, dynamic=dynamic, robots=robots, **(main or {}))))
        return worlds[-1]

    yield make
    for world in worlds:
        world.close()


def positions(world: World) -> list[float]:
    robot = world.bodies["gripper"]
    return [state[0] for state in world.pb.getJointStates(robot.body_id, robot.link_indices)]


def run(world: World, ticks: int) -> None:
    for _ in range(ticks):
        world.step()


def test_mimic_finger_follows_the_urdf_from_the_start(build):
    world = build()
    assert positions(world) == [0.03, 0.03]
    world.put("gripper/target", JointCommand(["left"], [0.05]))
    run(world, 300)
    assert positions(world) == pytest.approx([0.05, 0.05], abs=1e-6)


def test_without_a_coupling_the_other_finger_stays(build):
    world = build(mimic="", initial_joint_position={"left": 0.03, "right": 0.03})
    world.put("gripper/target", JointCommand(["left"], [0.05]))
    run(world, 300)
    assert positions(world) == pytest.approx([0.05, 0.03], abs=1e-6)


@pytest.mark.parametrize(
    ("mode", "target"),
    [
        ("POSITION_CONTROL", JointCommand(["left"], [0.05])),
        ("VELOCITY_CONTROL", JointCommand(["left"], [], [0.1])),
        ("TORQUE_CONTROL", JointCommand(["left"], [], [], [0.02])),
    ],
)
def test_multiplier_and_offset_of_the_yaml_hold_in_every_mode(build, mode, target):
    world = build(mimic="", **HALVES, setJointMotorControlArray={"controlMode": mode})
    assert positions(world) == pytest.approx([0.03, 0.025])
    world.put("gripper/target", target)
    for _ in range(150):
        world.step()
        left, right = positions(world)
        assert right == pytest.approx(0.5 * left + 0.01, abs=1e-5)
    assert left > 0.0315


def test_the_leader_decides_and_the_log_says_so_once(build, caplog):
    world = build()
    with caplog.at_level(logging.INFO):
        for _ in range(2):
            world.put("gripper/target", JointCommand(["left", "right"], [0.05, 0.0]))
            run(world, 150)
    assert positions(world) == pytest.approx([0.05, 0.05], abs=1e-6)
    told = [record.message for record in caplog.records if "right" in record.message]
    assert told == ["gripper: targets of 'right' have no effect: it follows 'left'"]


def test_it_is_put_with_its_leader_and_refused_alone(build):
    world = build(mimic="", **HALVES)
    world.act("gripper", "set_joint_state", JointCommand(["left", "right"], [0.04, 0.06]))
    assert positions(world) == pytest.approx([0.04, 0.03])
    run(world, 5)
    assert positions(world) == pytest.approx([0.04, 0.03], abs=1e-6)
    with pytest.raises(ValueError, match="expected joints that can be driven, got 'right' \\(follows 'left'\\)"):
        world.act("gripper", "set_joint_state", JointCommand(["right"], [0.04]))


def test_a_timed_motion_of_the_leader_arrives(build):
    world = build()
    motion = world.act("gripper", "move", TimedGoal({LEFT: 0.05}, 0.2))
    while not motion.is_over:
        world.step()
    assert motion.result.result().success
    assert positions(world) == pytest.approx([0.05, 0.05], abs=1e-4)


def test_gravity_of_the_follower_is_the_leaders_burden(build):
    sideways = {"setGravity": {"gravY": -9.81}}
    world = build(
        mimic='<mimic joint="left" multiplier="-1" offset="0.06"/>',  # both fingers move the same way
        main=sideways,
        gravity_compensation=True,
        setJointMotorControlArray={"controlMode": "TORQUE_CONTROL"},
    )
    run(world, 200)
    assert positions(world) == pytest.approx([0.03, 0.03], abs=1e-5)


def shift_mm(world: World, ticks: int) -> float:
    """Returns how far the box moves [mm] that the fingers hold."""
    start = world.bodies["box"].base_pose().position
    run(world, ticks)
    return math.dist(start, world.bodies["box"].base_pose().position) * 1e3


def held(anchor: int, y: float = 0.0) -> tuple[dict, ...]:
    """Returns a box between the fingers, as far as asked from the middle [m]."""
    contact = {"lateralFriction": 1.0, "frictionAnchor": anchor}
    return (box(half_extents_m=(0.02, 0.02, 0.02), baseMass=1.0, basePosition=[0.0, y, 1.0], changeDynamics=contact),)


GRIP = JointCommand(["left", "right"], [0.0, 0.0])


def test_object_held_by_coupled_fingers_with_anchors_does_not_drift(build):
    world = build(held(anchor=1))
    world.put("gripper/target", GRIP)
    run(world, 500)
    assert shift_mm(world, 2000) < 0.01


def test_without_anchors_friction_creeps(build):
    world = build(held(anchor=0))
    world.put("gripper/target", GRIP)
    run(world, 500)
    assert shift_mm(world, 2000) > 0.03


def test_coupled_fingers_centre_a_box_and_others_push_it_aside(build):
    world = build(held(anchor=1, y=0.005))
    world.put("gripper/target", GRIP)
    run(world, 1000)
    assert world.bodies["box"].base_pose().position[1] == pytest.approx(0.0, abs=2e-4)
    apart = build(held(anchor=1, y=0.005), "", initial_joint_position={"left": 0.03, "right": 0.03})
    apart.put("gripper/target", GRIP)
    run(apart, 1000)
    assert abs(apart.bodies["box"].base_pose().position[1]) > 0.01


def test_each_finger_presses_with_its_own_effort(build):
    world = build(held(anchor=1))
    world.put("gripper/target", GRIP)
    run(world, 500)
    touches = world.pb.getContactPoints(world.bodies["box"].body_id)
    for finger in (LEFT, RIGHT):
        assert sum(touch[9] for touch in touches if touch[4] == finger) == pytest.approx(20.0, rel=0.02)


@pytest.mark.parametrize(
    ("coupled", "message"),
    [
        ({"thumb": {"joint": "left"}}, "coupled_joints.thumb: unknown joint 'thumb'"),
        ({"right": {"joint": "thumb"}}, "joint 'right' follows 'thumb', which is no moving joint"),
        ({"right": {"joint": "left"}, "left": {"joint": "right"}}, "follows itself in the end"),
        ({"right": {"joint": "left", "multiplier": 0.0}}, "coupled_joints.right.multiplier: must not be 0"),
        ({"right": {"joint": "left", "offset": math.inf}}, "coupled_joints.right.offset: "),
        ({"right": {}}, "coupled_joints.right.joint: missing"),
    ],
)
def test_a_coupling_that_makes_no_sense_is_refused(build, coupled, message):
    with pytest.raises(ConfigError) as caught:
        build(mimic="", coupled_joints=coupled)
    assert message in str(caught.value)


def test_urdf_that_mimics_an_unknown_joint_is_refused(build):
    with pytest.raises(ConfigError, match="loadURDF.fileName: joint 'right' follows 'thumb', which is no moving joint"):
        build(mimic='<mimic joint="thumb"/>')
