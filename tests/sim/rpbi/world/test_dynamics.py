"""Friction, mass and the like, changed while the world runs."""

from __future__ import annotations

import math

import pybullet
import pytest
from worlds import FLOOR, box, iiwa, write_world

from custom_ros_tools.errors import UnknownNameError
from rpbi.bodies.dynamics import LinkDynamics, difference, read_dynamics
from rpbi.config.pybullet_models import ChangeDynamics
from rpbi.engine.client import Client
from rpbi.render.mirror import Mirror
from rpbi.world import World
from rpbi.world.load_log import replay

SLOPE = math.radians(20.0)


@pytest.fixture
def make(tmp_path):
    worlds = []

    def build(**parts):
        parts.setdefault("collision", (FLOOR,))
        worlds.append(World.from_file(write_world(tmp_path, setAdditionalSearchPath="pybullet_data_path", **parts)))
        return worlds[-1]

    yield build
    for world in worlds:
        world.close()


def run(world, ticks):
    for _ in range(ticks):
        world.step()


def on_a_slope(**more):
    """Gravity leans, so that the floor is a slope that holds a box of friction 0.5 and not one of 0.1."""
    gravity = {"gravX": 9.81 * math.sin(SLOPE), "gravZ": -9.81 * math.cos(SLOPE)}
    return {"setGravity": gravity, "dynamic": (box(basePosition=[0.0, 0.0, 0.1]),), **more}


def test_box_slides_once_its_friction_is_lowered(make):
    world = make(**on_a_slope())
    run(world, 1000)
    held = world.bodies["box"].base_pose().position[0]
    assert abs(held) < 1e-3
    world.change_dynamics("box", ChangeDynamics(lateralFriction=0.1))
    run(world, 1000)
    acceleration = 9.81 * (math.sin(SLOPE) - 0.1 * math.cos(SLOPE))
    assert world.bodies["box"].base_pose().position[0] - held == pytest.approx(acceleration / 2, rel=0.05)


def test_object_without_change_dynamics_has_the_defaults_of_pybullet(make):
    plain = {key: value for key, value in box().items() if key != "changeDynamics"}
    bare = Client()
    shape = bare.createCollisionShape(pybullet.GEOM_BOX, halfExtents=[0.1] * 3)
    expected = LinkDynamics(*bare.getDynamicsInfo(bare.createMultiBody(1.0, shape), -1))
    bare.disconnect()
    assert make(dynamic=(plain,)).dynamics("box") == expected


def test_heavier_box_presses_harder(make):
    world = make(dynamic=(box(basePosition=[0.0, 0.0, 0.1]),))
    run(world, 500)
    before = pressing(world)
    world.change_dynamics("box", ChangeDynamics(mass=7.0))
    run(world, 500)
    assert before == pytest.approx(9.81, rel=1e-3)
    assert pressing(world) == pytest.approx(7 * 9.81, rel=1e-3)


def pressing(world):
    return sum(touch[9] for touch in world.pb.getContactPoints(world.bodies["box"].body_id))


def test_link_changed_by_name_is_heavier_for_its_sensor(make):
    robot = iiwa(enabled_joint_force_torque_sensors=[{"joint": "lbr_iiwa_joint_7", "hz": 1000}])
    world = make(robots=(robot,))
    run(world, 500)
    mass = world.dynamics("iiwa/lbr_iiwa_link_7").mass
    before = force(world)
    world.change_dynamics("iiwa/lbr_iiwa_link_7", ChangeDynamics(mass=3 * mass))
    run(world, 500)
    assert before == pytest.approx(9.81 * mass, rel=1e-3)
    assert force(world) == pytest.approx(3 * before, rel=1e-3)


def force(world):
    return math.hypot(*next(each for each in world.step() if each.name == "iiwa/lbr_iiwa_joint_7").force)


def test_moments_of_inertia_follow_the_mass_unless_they_are_given(make):
    world = make(dynamic=(box(),), robots=(iiwa(),))
    for name in ("box", "iiwa/lbr_iiwa_link_3"):
        before = world.dynamics(name)
        world.change_dynamics(name, ChangeDynamics(localInertiaDiagonal=(0.1, 0.2, 0.25)))
        world.change_dynamics(name, ChangeDynamics(mass=4 * before.mass))
        assert world.dynamics(name).local_inertia_diagonal == pytest.approx((0.4, 0.8, 1.0))
        world.change_dynamics(name, ChangeDynamics(mass=1.0, localInertiaDiagonal=(0.1, 0.2, 0.25)))
        assert world.dynamics(name)[:3] == (1.0, before.lateral_friction, (0.1, 0.2, 0.25))


def test_damping_slows_a_box_down(make):
    flying = {"linearVelocity": [1.0, 0.0, 0.0]}
    world = make(collision=(), dynamic=(box(resetBaseVelocity=flying),), setGravity={"gravZ": 0.0})
    world.change_dynamics("box", ChangeDynamics(linearDamping=0.0))
    run(world, 500)
    assert world.pb.getBaseVelocity(world.bodies["box"].body_id)[0][0] == pytest.approx(1.0)
    world.change_dynamics("box", ChangeDynamics(linearDamping=0.9))
    run(world, 500)
    assert world.pb.getBaseVelocity(world.bodies["box"].body_id)[0][0] < 0.7


def test_replay_of_the_log_has_the_changes(make):
    world = make(dynamic=(box(),), robots=(iiwa(),))
    changes = {
        "box": ChangeDynamics(mass=3.0, restitution=0.7),
        "iiwa/lbr_iiwa_link_4": ChangeDynamics(mass=5.0),
        "floor": ChangeDynamics(lateralFriction=0.25, contactStiffness=1.0e4, contactDamping=100.0),
        "iiwa": ChangeDynamics(lateralFriction=0.33),
    }
    for name, change in changes.items():
        world.change_dynamics(name, change)
    copy = Client()
    bodies = replay(copy, world.log)
    for name in changes:
        body, _, link = name.partition("/")
        assert read_dynamics(bodies[body], link) == world.dynamics(name)
    copy.disconnect()


def test_renderer_takes_changes_of_dynamics(make, caplog):
    world = make(dynamic=(box(),))
    world.change_dynamics("box", ChangeDynamics(mass=3.0, lateralFriction=0.1))
    client = Client()
    mirror = Mirror(client)
    for entry in world.log:
        mirror.apply(entry)
    assert not caplog.records
    client.disconnect()


def test_change_of_a_removed_body_does_not_return(make):
    world = make(dynamic=(box(),))
    world.change_dynamics("box", ChangeDynamics(mass=3.0))
    kind, config = next(entry.arguments for entry in world.log if entry.name == "box")
    world.remove("box")
    world.add(kind, config)
    assert world.dynamics("box").mass == 1.0
    copy = Client()
    assert read_dynamics(replay(copy, world.log)["box"], "").mass == 1.0
    copy.disconnect()


@pytest.mark.parametrize(
    ("name", "change", "message"),
    [
        ("floor", {"mass": 2.0}, "mass: 'floor' is static"),
        ("iiwa", {"mass": 2.0}, "mass: 'iiwa' is static"),
        ("box", {"mass": 0.0}, r"mass: must be > 0 \[kg\]"),
        ("box", {"localInertiaDiagonal": (0.0, 1.0, 1.0)}, "localInertiaDiagonal: must be > 0"),
        ("box", {"jointDamping": 1.0}, "jointDamping: 'box' is not below a moving joint"),
        ("box", {"contactStiffness": 0.0, "contactDamping": 1.0}, "contactStiffness: must be > 0"),
        ("ghost", {"lateralFriction": 1.0}, "lateralFriction: 'ghost' has no collision shape"),
        ("box", {"mass": 0.0, "jointDamping": 1.0}, "mass: .*jointDamping: "),
    ],
)
def test_invalid_changes_are_refused_as_a_whole(make, name, change, message):
    shape = {"shapeType": "GEOM_SPHERE", "radius": 0.1}
    ghost = {"name": "ghost", "createVisualShape": shape}
    world = make(dynamic=(box(),), robots=(iiwa(),), visual=(ghost,))
    before, entries = world.dynamics(name), len(world.log)
    with pytest.raises(ValueError, match=message):
        world.change_dynamics(name, ChangeDynamics(**{"restitution": 0.1, **change}))
    assert world.dynamics(name) == before
    assert len(world.log) == entries


@pytest.mark.parametrize("name", ["bix", "box/lid", "iiwa/lbr_iiwa_link_9", ""])
def test_unknown_names_are_reported_with_known_ones(make, name):
    world = make(dynamic=(box(),), robots=(iiwa(),))
    for call in (lambda: world.dynamics(name), lambda: world.change_dynamics(name, ChangeDynamics(mass=1.0))):
        with pytest.raises(UnknownNameError, match="known are"):
            call()


def test_root_link_goes_by_its_own_name_too(make):
    world = make(robots=(iiwa(),))
    assert world.dynamics("iiwa/lbr_iiwa_link_0") == world.dynamics("iiwa")


def test_root_link_of_a_mobile_base_is_the_urdfs(make):
    world = make(robots=(iiwa("mobile", planar_base={}),))
    world.change_dynamics("mobile", ChangeDynamics(lateralFriction=0.125))
    assert world.dynamics("mobile") == world.dynamics("mobile/lbr_iiwa_link_0")
    assert world.dynamics("mobile/lbr_iiwa_link_0").lateral_friction == 0.125
    with pytest.raises(UnknownNameError, match="known are lbr_iiwa_link_0, lbr_iiwa_link_1"):
        world.dynamics("mobile/planar_base/x")


PRESENT = LinkDynamics(1.0, 0.5, (0.1, 0.1, 0.1), (0, 0, 0), (0, 0, 0, 1), 0.0, 0.0, 0.0, -1.0, -1.0, 2, 0.001)


def test_only_differing_values_are_changed():
    assert difference(PRESENT, PRESENT) == {}
    assert difference(PRESENT, PRESENT._replace(mass=2.0, local_inertia_pos=())) == {"mass": 2.0}
    wanted = PRESENT._replace(contact_stiffness=100.0, contact_damping=3.0)
    assert difference(PRESENT, wanted) == {"contactStiffness": 100.0, "contactDamping": 3.0}
    soft = PRESENT._replace(contact_stiffness=50.0, contact_damping=3.0)
    assert difference(soft, soft._replace(contact_damping=4.0)) == {"contactStiffness": 50.0, "contactDamping": 4.0}


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"mass": math.nan}, "mass: must be finite, got nan"),
        ({"lateral_friction": -0.1}, "lateral_friction: must be >= 0, got -0.1"),
        ({"local_inertia_diagonal": (0.1, 0.1)}, "local_inertia_diagonal: expected 3 numbers or none, got 2"),
        ({"local_inertia_diagonal": (0.1, 0.1, math.inf)}, "local_inertia_diagonal: must be finite"),
        ({"local_inertia_pos": (0.1, 0, 0)}, "local_inertia_pos: cannot be changed"),
        ({"body_type": 1}, "body_type: cannot be changed, expected 2, got 1"),
        ({"contact_stiffness": 100.0}, "contact_damping: must be >= 0 when the other is set, got -1"),
        ({"mass": -1.0, "restitution": math.inf}, "mass: .*; restitution: "),
    ],
)
def test_nonsense_is_named_by_field(fields, message):
    with pytest.raises(ValueError, match=message):
        difference(PRESENT, PRESENT._replace(**fields))


def test_link_stiffness_and_damping_are_as_requested(make):
    """Stiffness and damping of a link are what was asked for, as those of a base are."""
    world = make(robots=(iiwa(),))
    name = "iiwa/lbr_iiwa_link_5"
    world.change_dynamics(name, ChangeDynamics(contactStiffness=1.0e4, contactDamping=50.0, restitution=0.2))
    found = world.dynamics(name)
    assert (found.restitution, found.contact_damping, found.contact_stiffness) == pytest.approx((0.2, 50.0, 1.0e4))
