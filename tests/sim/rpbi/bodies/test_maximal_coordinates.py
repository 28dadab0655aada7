"""Objects in maximal coordinates: friction between them is Coulomb's in all directions, and all else works as ever."""

from __future__ import annotations

import math

import pytest
from soft_meshes import DEFORMABLE, GROUND, block
from worlds import ball, box, iiwa, write_world

from custom_ros_tools.errors import ConfigError
from rpbi.bodies.dynamic import DynamicObject
from rpbi.bodies.dynamics import read_dynamics
from rpbi.config.pybullet_models import ChangeDynamics
from rpbi.control.joint_command import JointCommand
from rpbi.engine.client import Client
from rpbi.geometry import Pose
from rpbi.render.mirror import Mirror
from rpbi.samples import ContactsSample
from rpbi.world import World
from rpbi.world.load_log import replay

MAXIMAL = {"useMaximalCoordinates": True}
FLOOR = {**GROUND, "name": "floor", "changeDynamics": {"lateralFriction": 1.0}}
UNDAMPED = {"lateralFriction": 0.5, "linearDamping": 0.0, "angularDamping": 0.0}


@pytest.fixture
def build(tmp_path):
    worlds = []

    def build_world(*dynamic, floor=None, **more) -> World:
        floor = {**FLOOR, **MAXIMAL, **(floor or {})}
        worlds.append(World.from_file(write_world(tmp_path, collision=(floor,), dynamic=dynamic, **more)))
        return worlds[-1]

    yield build_world
    for world in worlds:
        world.close()


def run(world, ticks):
    return [sample for _ in range(ticks) for sample in world.step()]


def braked(build, direction_deg, yaw_deg, time_step_s, **keys):
    """Returns the deceleration of a sliding box over mu g: along its motion, and across."""
    x, y = math.cos(math.radians(direction_deg)), math.sin(math.radians(direction_deg))
    half_yaw = math.radians(yaw_deg) / 2
    sliding = box(
        half_extents_m=(0.05, 0.05, 0.02),
        basePosition=[0.0, 0.0, 0.02],
        baseOrientation=[0.0, 0.0, math.sin(half_yaw), math.cos(half_yaw)],
        changeDynamics=UNDAMPED,
        resetBaseVelocity={"linearVelocity": [x, y, 0.0]},
        **keys,
    )
    world = build(sliding, floor=keys, timeStep=time_step_s)
    run(world, 20)
    before = world.bodies["box"].base_twist().linear
    run(world, 50)
    after = world.bodies["box"].base_twist().linear
    lost_x, lost_y = ((old - new) / (50 * time_step_s * 0.5 * 9.81) for old, new in zip(before[:2], after[:2]))
    return x * lost_x + y * lost_y, x * lost_y - y * lost_x


@pytest.mark.parametrize("time_step_s", [0.001, 0.002])
@pytest.mark.parametrize("yaw_deg", [0, 20, 45])
@pytest.mark.parametrize("direction_deg", [0, 30, 45, 75])
def test_friction_is_coulombs_in_every_direction(build, direction_deg, yaw_deg, time_step_s):
    along, across = braked(build, direction_deg, yaw_deg, time_step_s, **MAXIMAL)
    assert along == pytest.approx(1.0, abs=0.01)
    assert across == pytest.approx(0.0, abs=0.01)


def test_friction_of_other_objects_is_not(build):
    assert braked(build, 45, 45, 0.001, useMaximalCoordinates=False)[0] < 0.92


@pytest.mark.parametrize("is_maximal", [True, False])
def test_a_moving_plate_carries_or_warns_that_it_does_not(build, caplog, is_maximal):
    keys = {"object_tf": {"tf_id": "plate", "hz": 50}, "useMaximalCoordinates": is_maximal}
    plate = box("plate", basePosition=[0.0, 0.0, 0.5], **keys)
    del plate["baseMass"]
    world = build(box("load", (0.05, 0.05, 0.05), basePosition=[0.0, 0.0, 0.65]), floor=plate)
    world.put("plate/pose", Pose((0.0, 0.0, 0.5)))
    run(world, 100)
    assert not caplog.records, "it was put there"
    for step in range(1, 11):
        world.put("plate/pose", Pose((0.005 * step, 0.0, 0.5)))
        run(world, 20)
    carried_m = world.bodies["load"].base_pose().position[0]
    warnings = [each.message for each in caplog.records]
    if is_maximal:
        assert carried_m < 0.005 and len(warnings) == 1
        assert warnings[0].startswith("plate: object_tf: moves without a velocity, because of useMaximalCoordinates")
    else:
        assert carried_m > 0.03 and not warnings


def test_dynamics_that_pybullet_does_not_report_are_the_bodys_own(build):
    """PyBullet leaves in its place what it last told of another body, here of the arm."""
    bouncy = {"restitution": 0.3, "contactStiffness": 1.0e4, "contactDamping": 30.0}
    world = build(box(**MAXIMAL), ball(basePosition=[1, 0, 1], changeDynamics=bouncy, **MAXIMAL), robots=(iiwa(),))
    world.change_dynamics("iiwa", ChangeDynamics(restitution=0.9, contactStiffness=5.0, contactDamping=7.0))
    for name, restitution, damping, stiffness in (("box", 0.0, -1.0, -1.0), ("ball", 0.3, 30.0, 1.0e4)):
        world.dynamics("iiwa/lbr_iiwa_link_3")
        told = world.dynamics(name)
        assert (told.restitution, told.contact_damping, told.contact_stiffness) == (restitution, damping, stiffness)
        assert (told.local_inertia_pos, told.local_inertia_orn) == ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
    world.change_dynamics("box", ChangeDynamics(restitution=0.7))
    assert world.dynamics("box").restitution == 0.7
    copy = Client()
    bodies = replay(copy, world.log)
    assert all(read_dynamics(bodies[name], "") == world.dynamics(name) for name in ("box", "ball", "floor"))
    copy.disconnect()


def test_its_mass_stays_when_its_moments_of_inertia_are_changed(build):
    world = build(box(basePosition=[0.0, 0.0, 0.1], baseMass=2.0, **MAXIMAL))
    world.change_dynamics("box", ChangeDynamics(localInertiaDiagonal=(0.1, 0.2, 0.25)))
    assert world.dynamics("box").mass == 2.0
    assert world.dynamics("box").local_inertia_diagonal == pytest.approx((0.1, 0.2, 0.25))
    world.change_dynamics("box", ChangeDynamics(mass=4.0))
    assert world.dynamics("box").local_inertia_diagonal == pytest.approx((0.2, 0.4, 0.5))


def test_a_size_whose_moment_of_inertia_is_infinite_is_refused():
    with pytest.raises(ConfigError, match="radius: must be within"):
        DynamicObject.Config.parse(ball("huge", radius_m=1e300, **MAXIMAL), "huge.yaml")


def test_contacts_name_its_link_and_add_up_to_its_weight(build):
    told = {"contacts": {"hz": 1000}}
    world = build(box(basePosition=[0.0, 0.0, 0.1], baseMass=2.0, **told, **MAXIMAL), floor=told)
    run(world, 500)
    latest = {sample.name: sample for sample in world.step() if isinstance(sample, ContactsSample)}
    assert latest["box"].force == pytest.approx((0.0, 0.0, 2.0 * 9.81), abs=0.05)
    for name, other in (("box", "floor"), ("floor", "box")):
        ends = {(point.other_body, point.link, point.other_link) for point in latest[name].points}
        assert ends == {(other, "link0", "link0")}


def test_friction_of_a_resting_body_can_be_lowered(build):
    """Contacts that last are made anew."""
    angle = math.radians(20.0)
    gravity = {"gravX": 9.81 * math.sin(angle), "gravZ": -9.81 * math.cos(angle)}
    world = build(box(basePosition=[0, 0, 0.1], changeDynamics=UNDAMPED, **MAXIMAL), setGravity=gravity)
    run(world, 200)
    assert abs(world.bodies["box"].base_twist().linear[0]) < 1e-3
    world.change_dynamics("box", ChangeDynamics(lateralFriction=0.1))
    run(world, 200)
    speed = 0.2 * 9.81 * (math.sin(angle) - 0.1 * math.cos(angle))
    assert world.bodies["box"].base_twist().linear[0] == pytest.approx(speed, rel=0.02)


def test_a_collision_object_is_felt_where_tf_puts_it(build):
    world = build(ball(basePosition=[0.0, 0.0, 1.2], **MAXIMAL), floor={"object_tf": {"tf_id": "lift"}})
    world.put("floor/pose", Pose((0.0, 0.0, 1.0)))
    run(world, 1000)
    assert world.bodies["ball"].base_pose().position[2] == pytest.approx(1.1, abs=1e-3)


def test_the_renderer_shows_it_where_it_is(build):
    world = build(ball(basePosition=[0.0, 0.0, 0.5], **MAXIMAL))
    run(world, 100)
    client = Client()
    mirror = Mirror(client)
    for entry in world.log:
        mirror.apply(entry)
    state = world.bodies["ball"].state()
    mirror.show([state])
    assert client.getBasePositionAndOrientation(1)[0] == pytest.approx(state.base[:3])
    client.disconnect()


def test_session_with_an_arm_is_identical_after_a_reset(build):
    heap = (box(f"body{turn}", basePosition=[0.45, 0.02 * turn, 0.1 + 0.21 * turn], **MAXIMAL) for turn in range(3))
    start = {"lbr_iiwa_joint_2": 40.0, "lbr_iiwa_joint_4": -60.0}
    world = build(*heap, robots=(iiwa(initial_joint_position=start),))

    def session():
        hashes = []
        for tick in range(1000):
            if tick % 100 == 0:
                world.put("iiwa/target", JointCommand(["lbr_iiwa_joint_1"], [0.6 * (-1.0) ** (tick // 100)]))
            world.step()
            hashes.append(
                (world.state_hash(), bool(world.contacts.sample(world.bodies["iiwa"], world.clock.tick).points))
            )
        return hashes

    first = session()
    assert any(is_touched for _, is_touched in first), "the arm is in the heap"
    world.reset()
    assert session() == first


def test_dynamic_body_is_refused_in_worlds_with_soft_bodies(build):
    with pytest.raises(ConfigError, match=r"box\.yaml: useMaximalCoordinates: soft bodies have no contacts with"):
        build(box(**MAXIMAL), **DEFORMABLE)


def test_soft_bodies_touch_urdf_bodies_with_inertia_of_their_file(build, tmp_path):
    """The example `soft_body` of the release has one; PyBullet reports no shapes of it."""
    load = {"fileName": "cube.urdf", "basePosition": [0.0, 0.0, 0.72], **MAXIMAL}
    jelly = block(tmp_path, load={"basePosition": [0.0, 0.0, 0.11]})
    world = build(
        floor={"useMaximalCoordinates": False},
        urdfs=({"name": "cube", "loadURDF": load},),
        soft=(jelly,),
        timeStep=0.004,
        **DEFORMABLE,
    )
    assert world.dynamics("cube").local_inertia_diagonal == (1.0, 1.0, 1.0), "those of the file"
    run(world, 300)
    assert 0.6 < world.bodies["cube"].base_pose().position[2] < 0.72, "it stands on the jelly, which is 0.2 m high"
