"""What scripts hand to a world as plain data is what nodes hand to it as named tuples."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from mobile_base import mobile_base
from worlds import FLOOR, ball, box, iiwa, write_world

from custom_ros_tools.errors import ConfigError, UnknownNameError
from rpbi.config.pybullet_models import ChangeDynamics
from rpbi.config.world import AttachmentConfig
from rpbi.control.controllers.cartesian_impedance import PoseTarget
from rpbi.control.controllers.manager import ControllerSwitch
from rpbi.control.external_wrenches import ExternalWrench
from rpbi.control.joint_command import JointCommand
from rpbi.control.motors import MotorGains
from rpbi.control.trajectories.request import TrajectoryPoint, TrajectoryRequest
from rpbi.geometry import Pose, Twist
from rpbi.world import World
from rpbi.world.actions import RecordedTrajectory, TimedGoal

JOINT = "lbr_iiwa_joint_2"
CONTROLLERS = {
    "springs": {"type": "joint_impedance", "active": False},
    "hold": {"type": "cartesian_impedance", "link": "lbr_iiwa_link_7", "active": False},
}
TURNED = (0.0, 0.6, 0.0, 0.8)


def make_world(folder: Path) -> World:
    ghost = {**iiwa("ghost"), "is_visual_robot": True, "object_tf": {"tf_id": "f"}}
    arm = iiwa(controllers=CONTROLLERS, joint_trajectory_controller={"allow_partial_joints_goal": True})
    path = write_world(folder, collision=(FLOOR,), dynamic=(box(),), robots=(arm, ghost, mobile_base(folder)))
    return World.from_file(path)


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    world = make_world(tmp_path_factory.mktemp("world"))
    yield world
    world.close()


@pytest.mark.parametrize(
    ("slot", "plain", "named"),
    [
        ("iiwa/target", {JOINT: np.float64(0.5)}, JointCommand([JOINT], [0.5])),
        ("ghost/target", {JOINT: 1}, JointCommand([JOINT], [1.0])),
        ("iiwa/springs/target", {JOINT: 0.5}, JointCommand((JOINT,), (0.5,))),
        ("ghost/pose", {"position": [1, 2, 3], "quat_xyzw": np.array(TURNED)}, Pose((1.0, 2.0, 3.0), TURNED)),
        ("ghost/pose", ([1, 2, 3], TURNED), Pose((1.0, 2.0, 3.0), TURNED)),
        ("iiwa/hold/target", {"position": [1, 2, 3]}, PoseTarget(Pose((1.0, 2.0, 3.0)))),
        ("mobile/cmd_vel", {"linear": [0.1, 0.2, 0.0]}, Twist((0.1, 0.2, 0.0))),
        ("box/external_wrench", {"force": [1, 2, 3]}, ExternalWrench((1.0, 2.0, 3.0))),
    ],
)
def test_input_accepts_a_mapping_instead_of_a_named_tuple(world, slot, plain, named):
    check = world.inputs[slot].check
    assert check(plain) == check(named)


@pytest.mark.parametrize(
    ("slot", "given", "message"),
    [
        ("iiwa/target", {"lbr_iiwa_joint_9": 0.5}, "unknown joint 'lbr_iiwa_joint_9': .*did you mean"),
        ("iiwa/target", {JOINT: "0.5"}, f"expected a number for joint '{JOINT}', got text '0.5'"),
        ("iiwa/target", {JOINT: True}, f"expected a number for joint '{JOINT}', got true"),
        ("iiwa/target", {JOINT: math.nan}, f"values must be finite, got nan for joint '{JOINT}'"),
        ("iiwa/target", {2: 0.5}, "expected names of joints, got 2"),
        ("iiwa/target", [0.5], r"expected a JointCommand or a mapping of joints to numbers, got \[0.5\]"),
        ("ghost/pose", {"positon": [0, 0, 0]}, "unknown key 'positon'; did you mean 'position'?"),
        ("ghost/pose", {"position": [0, 0]}, r"position\[2\]: missing"),
        ("ghost/pose", {"position": [0, 0, math.inf]}, r"position\[2\]: input should be a finite number"),
        ("ghost/pose", [0, 0, 1], "expected a Pose, or a mapping with position, quat_xyzw; got"),
        ("ghost/pose", "here", "expected a Pose, or a mapping with position, quat_xyzw; got text 'here'"),
        ("mobile/cmd_vel", {"linear": 0.1}, "linear: "),
        ("box/external_wrench", {"torque": [0, 0, 1]}, "force: missing"),
        ("box/external_wrench", {"force": [1, 2, 3], "link": "lid"}, "unknown link of box 'lid'"),
    ],
)
def test_refused_value_is_named_and_nothing_is_queued(world, slot, given, message):
    world.mailbox.drain()
    with pytest.raises((ValueError, UnknownNameError), match=message):
        world.put(slot, given)
    assert not world.mailbox.drain()


ACTS = [
    ("iiwa", "move", {"positions": {JOINT: 0.4}, "duration_s": 0.05}, TimedGoal({1: 0.4}, 0.05)),
    ("iiwa", "stop_motion", "enough", "enough"),
    ("iiwa", "set_joint_state", {JOINT: 0.3}, JointCommand([JOINT], [0.3])),
    ("iiwa", "set_gains", {"names": [JOINT], "position": [0.2]}, MotorGains([JOINT], [0.2], [])),
    ("iiwa", "switch_controllers", {"start": ["springs"]}, ControllerSwitch(["springs"], [])),
    ("iiwa", "switch_controllers", {"stop": ["springs"]}, ControllerSwitch([], ["springs"])),
    ("box", "teleport", {"position": [0.5, 0.5, 0.5]}, Pose((0.5, 0.5, 0.5))),
    ("box", "push", {"force": [0, 5, 0], "duration_s": 0.01}, ExternalWrench((0.0, 5.0, 0.0), duration_s=0.01)),
    (
        "iiwa",
        "follow",
        {"request": {"joint_names": [JOINT], "points": [{"time_s": 0.1, "positions": [0.5]}]}},
        RecordedTrajectory(TrajectoryRequest((JOINT,), (TrajectoryPoint(0.1, (0.5,)),))),
    ),
    ("iiwa", "cancel", "enough", "enough"),
    ("iiwa", "switch_mode", "VELOCITY_CONTROL", 0),
]


def test_actions_with_mappings_equal_those_with_named_tuples(tmp_path):
    hashes = []
    for column in (2, 3):
        world = make_world(tmp_path)
        for act in ACTS:
            world.act(act[0], act[1], act[column])
            for _ in range(10):
                world.step()
        hashes.append(world.state_hash())
        world.close()
    assert hashes[0] == hashes[1]


@pytest.mark.parametrize(
    ("action", "value", "message"),
    [
        ("mov", {}, "unknown action 'mov': .*did you mean 'move'?"),
        ("move", {"positions": {"elbow": 0.1}, "duration_s": 1.0}, "unknown joint 'elbow'"),
        ("move", {"positions": {JOINT: 0.1}}, "duration_s: missing"),
        ("set_joint_state", {JOINT: 9.0}, f"joint '{JOINT}' must be within"),
        ("switch_mode", "VELOCITY", "unknown control mode 'VELOCITY'; did you mean 'VELOCITY_CONTROL'?"),
        ("teleport", {"position": [0.0, math.nan, 0.0]}, r"position\[1\]: input should be a finite number"),
    ],
)
def test_actions_that_are_refused_are_named_and_not_noted(world, action, value, message):
    before = world.state_hash()
    world.commands.clear()
    with pytest.raises((ValueError, UnknownNameError), match=message):
        world.act("iiwa", action, value)
    assert world.state_hash() == before


def test_objects_attachments_and_dynamics_come_by_mappings(tmp_path):
    hashes = []
    for plain in (True, False):
        world = World.from_file(write_world(tmp_path, collision=(FLOOR,), dynamic=(box(basePosition=[0.0, 0.0, 0.1]),)))
        added = world.add("dynamic", ball(basePosition=[0.0, 0.0, 0.35]))
        rope = {"name": "rope", "parent": "box", "child": "ball"}
        world.attach(rope if plain else AttachmentConfig.parse(rope, "rope"))
        world.change_dynamics("ball", {"mass": 2.0} if plain else ChangeDynamics.parse({"mass": 2.0}, "ball"))
        for _ in range(20):
            world.step()
        hashes.append(world.state_hash())
        with pytest.raises(ConfigError, match="ball2: baseMas: unknown key 'baseMas'; did you mean 'baseMass'?"):
            world.add("dynamic", {**ball("ball2"), "baseMas": 1.0})
        assert list(world.bodies) == ["floor", "box", "ball"] and world.bodies["ball"] is added
        world.close()
    assert hashes[0] == hashes[1]
