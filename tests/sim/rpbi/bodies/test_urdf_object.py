"""URDF objects: doors, drawers and cups move as their URDF says, and no motor holds them."""

from __future__ import annotations

import logging
import math

import pybullet
import pytest
from gripper import gripper
from worlds import FLOOR, ball, write_world

from custom_ros_tools.errors import ConfigError
from rpbi.bodies.urdf_object import UrdfObject
from rpbi.control.external_wrenches import ExternalWrench
from rpbi.engine.client import Client
from rpbi.geometry import Pose
from rpbi.render.mirror import Mirror
from rpbi.samples import LinkPoseSample
from rpbi.world import World

HINGE_INERTIA = 0.1 + 2.0 * 0.5**2  # [kg m^2] of the leaf about the hinge
DOOR = """
<robot name="door">
  <link name="frame"><inertial><origin xyz="0 0 0.3"/><mass value="1"/>
    <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="leaf">
    <inertial><origin xyz="0.5 0 0"/><mass value="2"/>
      <inertia ixx="0.01" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><origin xyz="0.5 0 0"/><geometry><box size="0.9 0.04 1"/></geometry></collision>
  </link>
  <joint name="hinge" type="{kind}">
    <parent link="frame"/><child link="leaf"/><axis xyz="0 0 1"/>
    <limit lower="-1.5" upper="1.5" effort="100" velocity="100"/>{dynamics}
  </joint>
</robot>
"""


@pytest.fixture
def build(tmp_path):
    worlds = []

    def build_world(dynamics="", kind="revolute", fixed=True, load=None, main=None, **more) -> World:
        # PyBullet caches files by name, also from one test to the next.
        file = tmp_path / f"door{len(worlds)}.urdf"
        file.write_text(DOOR.format(dynamics=dynamics, kind=kind))
        door = {
            "name": "door",
            "loadURDF": {
                "fileName": str(file),
                "useFixedBase": fixed,
                **(load or {}),
            },
            **more,
        }
        worlds.append(World.from_file(write_world(tmp_path, urdfs=(door,), **(main or {}))))
        world = worlds[-1]
        body = world.bodies["door"].body_id
        for link in (-1, 0):
            world.pb.changeDynamics(body, link, linearDamping=0.0, angularDamping=0.0)
        return world

    yield build_world
    for world in worlds:
        world.close()


def run(world, ticks):
    return [sample for _ in range(ticks) for sample in world.step()]


def hinge(world):
    """Returns angle [rad] and rate [rad/s] of the hinge."""
    return world.pb.getJointState(world.bodies["door"].body_id, 0)[:2]


def turn(world, rate):
    world.pb.resetJointState(world.bodies["door"].body_id, 0, -1.0, rate)


def test_a_joint_without_friction_keeps_turning(build):
    world = build()
    assert type(world.bodies["door"]) is UrdfObject
    turn(world, 1.0)
    run(world, 500)
    assert hinge(world) == pytest.approx((-0.5, 1.0), abs=1e-3)


def test_the_urdfs_damping_slows_a_joint_down_exponentially(build):
    world = build('<dynamics damping="0.3"/>')
    turn(world, 1.0)
    run(world, 500)
    assert hinge(world)[1] == pytest.approx(math.exp(-0.3 / HINGE_INERTIA * 0.5), rel=1e-3)


def test_urdf_friction_slows_a_joint_evenly_and_then_holds_it(build):
    world = build('<dynamics friction="0.6"/>')
    turn(world, 1.0)
    run(world, 500)
    assert hinge(world)[1] == pytest.approx(1.0 - 0.6 / HINGE_INERTIA * 0.5, rel=1e-3)
    run(world, 600)
    assert hinge(world)[1] == pytest.approx(0.0, abs=1e-6)


def test_a_vertical_drawer_falls_unless_its_friction_carries_it(build):
    weight_n = 2.0 * 9.81
    falling = build(kind="prismatic")
    run(falling, 300)
    assert hinge(falling)[1] == pytest.approx(-9.81 * 0.3, rel=1e-2)
    held = build(f'<dynamics friction="{1.02 * weight_n}"/>', kind="prismatic")
    run(held, 300)
    assert hinge(held) == pytest.approx((0.0, 0.0), abs=1e-6)


def test_a_ball_joint_swings_freely(build):
    world = build(kind="spherical")
    world.pb.resetJointStateMultiDof(world.bodies["door"].body_id, 0, [0, 0, 0, 1], [0.0, 0.0, 1.0])
    run(world, 200)
    rate = world.pb.getJointStateMultiDof(world.bodies["door"].body_id, 0)[1]
    assert math.hypot(*rate) > 0.9


def test_the_renderers_copy_turns_ball_joints_too(build):
    world = build(kind="spherical")
    turn = pybullet.getQuaternionFromEuler([0.3, -0.2, 0.9])
    world.pb.resetJointStateMultiDof(world.bodies["door"].body_id, 0, turn)
    client = Client()
    mirror = Mirror(client)
    try:
        for entry in world.log:
            mirror.apply(entry)
        mirror.show([body.state() for body in world.bodies.values()])
        assert client.getJointStateMultiDof(0, 0)[0] == pytest.approx(turn)
    finally:
        mirror.close()
        client.disconnect()


def test_a_ball_pushes_the_door_open(build):
    world = build(
        main={"dynamic": (ball(basePosition=[0.8, -0.3, 0.0], resetBaseVelocity={"linearVelocity": [0, 3.0, 0]}),)}
    )
    run(world, 300)
    assert hinge(world)[1] > 0.5


def test_fixed_base_follows_tf_with_its_urdf_frame(build):
    world = build(object_tf={"tf_id": "hand"})
    assert set(world.inputs) == {"door/pose", "door/external_wrench"}
    world.put("door/pose", Pose((1.0, 2.0, 3.0)))
    run(world, 1)
    assert world.bodies["door"].base_pose().position == pytest.approx((1.0, 2.0, 3.0))


def test_body_without_mass_counts_as_fixed(build):
    world = build(load={"fileName": "plane.urdf", "useFixedBase": False}, object_tf={"tf_id": "hand"})
    assert list(world.inputs) == ["door/pose"]


def test_a_floating_base_starts_with_its_velocity_and_follows_nothing(build, caplog):
    with caplog.at_level(logging.WARNING):
        world = build(fixed=False, object_tf={"tf_id": "hand"}, resetBaseVelocity={"linearVelocity": [1.0, 0.0, 0.0]})
    assert caplog.messages == ["door: object_tf: has no effect: physics moves a base that is not fixed"]
    assert "door/pose" not in world.inputs
    run(world, 100)
    position = world.bodies["door"].base_pose().position
    # The leaf hangs on the frame by a hinge, so the frame alone does not keep all of its speed.
    assert 0.03 < position[0] < 0.11
    assert position[2] == pytest.approx(-0.5 * 9.81 * 0.1**2, rel=0.05)


def test_velocity_of_a_fixed_base_is_warned_of(build, caplog):
    build(resetBaseVelocity={"linearVelocity": [1.0, 0.0, 0.0]})
    assert "door: resetBaseVelocity: has no effect: the base is fixed" in caplog.text


def test_its_links_are_broadcast_at_the_rate_asked_for(build):
    world = build(broadcast_hz=100)
    samples = [sample for sample in run(world, 100) if isinstance(sample, LinkPoseSample)]
    assert len(samples) == 10
    assert samples[0].frames == ("rpbi/door/frame", "rpbi/door/leaf")


def test_broken_urdf_is_reported_with_file_and_key(tmp_path):
    (tmp_path / "broken.urdf").write_text("<robot>")
    door = {"name": "door", "loadURDF": {"fileName": str(tmp_path / "broken.urdf")}}
    with pytest.raises(ConfigError, match=r"^door.yaml: loadURDF.fileName: .*broken.urdf is not XML"):
        World.from_file(write_world(tmp_path, collision=(FLOOR,), urdfs=(door,)))


def test_unknown_key_is_refused(tmp_path):
    door = {"name": "door", "loadURDF": {"fileName": "plane.urdf"}, "broadcast_Hz": 3}
    with pytest.raises(ConfigError, match="did you mean 'broadcast_hz'"):
        World.from_file(write_world(tmp_path, urdfs=(door,)))


def test_joints_follow_others_as_the_urdf_says(tmp_path):
    write = gripper(tmp_path, '<mimic joint="left" multiplier="0.5" offset="0.01"/>')
    thing = {"name": "gripper", "loadURDF": write["loadURDF"]}
    world = World.from_file(write_world(tmp_path, urdfs=(thing,), setGravity={}))
    world.act("gripper", "push", ExternalWrench((0.0, 0.05, 0.0), link="left_finger"))
    run(world, 300)
    left, right = (state[0] for state in world.pb.getJointStates(world.bodies["gripper"].body_id, (0, 1)))
    assert left > 0.01
    assert right == pytest.approx(0.5 * left + 0.01, abs=1e-5)
    world.close()
