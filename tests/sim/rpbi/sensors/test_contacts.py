"""Contacts: what the sensor tells agrees with statics, Coulomb and Newton, and with what PyBullet was asked."""

from __future__ import annotations

import math

import pybullet
import pytest
from worlds import BOX_FLOOR, FLOOR, ball, box, iiwa, write_world

from custom_ros_tools.errors import ConfigError, PhysicsError
from rpbi.geometry import Pose
from rpbi.samples import ContactArrowsSample, ContactsSample
from rpbi.world import World
from rpbi.world.loading import load_object

MASS_KG = 2.0
GRAVITY = 9.81
TOLD = {"hz": 1000, "arrows_hz": 100}


@pytest.fixture
def build(tmp_path):
    worlds = []

    def build_world(*dynamic, floor=FLOOR, **more) -> World:
        worlds.append(World.from_file(write_world(tmp_path, collision=(floor,), dynamic=dynamic, **more)))
        return worlds[-1]

    yield build_world
    for world in worlds:
        world.close()


def resting_box(name="box", height_m=0.1, **more):
    config = {"baseMass": MASS_KG, "basePosition": [0.0, 0.0, height_m], "contacts": TOLD, **more}
    return box(name, **config)


def run(world, ticks):
    """Steps and returns the last contacts of each body."""
    latest = {}
    for _ in range(ticks):
        for sample in world.step():
            if isinstance(sample, ContactsSample):
                latest[sample.name] = sample
    return latest


@pytest.mark.parametrize("sub_steps", [0, 1, 4])
def test_forces_on_a_resting_box_add_up_to_its_weight(build, sub_steps):
    world = build(resting_box(), setPhysicsEngineParameter={"numSubSteps": sub_steps})
    contacts = run(world, 1000)["box"]
    assert contacts.force == pytest.approx((0.0, 0.0, MASS_KG * GRAVITY), rel=0.01, abs=0.01)


def test_a_contact_names_both_ends_and_points_towards_the_body(build):
    world = build(resting_box(), floor={**FLOOR, "contacts": TOLD})
    latest = run(world, 500)
    for name, other, up in (("box", "floor", 1.0), ("floor", "box", -1.0)):
        assert latest[name].points
        for point in latest[name].points:
            assert (point.other_body, point.link, point.other_link) == (other, "link0", "link0")
            assert point.normal == pytest.approx((0.0, 0.0, up), abs=1e-6)
            assert point.normal_force >= 0.0
            assert point.position[2] == pytest.approx(0.0, abs=1e-3)
            assert abs(point.depth) < 1e-3
    assert latest["box"].force == pytest.approx(tuple(-each for each in latest["floor"].force), abs=1e-9)


def test_contacts_name_the_links(build):
    world = build(
        ball("ball", 0.1, basePosition=[0.0, 0.0, 1.45], contacts=TOLD),
        robots=(iiwa(contacts=TOLD),),
    )
    touched = set()
    for _ in range(600):
        for sample in world.step():
            if isinstance(sample, ContactsSample) and sample.name == "ball":
                touched |= {(point.other_body, point.other_link) for point in sample.points}
    assert ("iiwa", "lbr_iiwa_link_7") in touched


def test_a_stack_shares_its_weight_out(build):
    world = build(resting_box("lower"), resting_box("upper", 0.3))
    latest = run(world, 2000)
    weight_n = MASS_KG * GRAVITY
    by_floor = sum(point.force[2] for point in latest["lower"].points if point.other_body == "floor")
    by_upper = sum(point.force[2] for point in latest["lower"].points if point.other_body == "upper")
    assert by_floor == pytest.approx(2.0 * weight_n, rel=0.01)
    assert by_upper == pytest.approx(-weight_n, rel=0.01)
    assert latest["lower"].force[2] == pytest.approx(weight_n, rel=0.01)


@pytest.mark.parametrize("friction", [0.2, 0.5, 0.8])
@pytest.mark.parametrize("beyond_rad", [-0.02, -0.01, 0.01, 0.02])
def test_a_box_slides_iff_the_slope_exceeds_friction(build, friction, beyond_rad):
    angle = math.atan(friction) + beyond_rad
    quat = pybullet.getQuaternionFromEuler([0.0, angle, 0.0])
    position = pybullet.rotateVector(quat, (0.0, 0.0, 0.05))
    flat = resting_box(
        half_extents_m=(0.2, 0.2, 0.05),
        basePosition=list(position),
        baseOrientation=list(quat),
        changeDynamics={"lateralFriction": friction},
    )
    world = build(flat, floor={**FLOOR, "object_tf": {"tf_id": "slope"}})
    world.put("floor/pose", Pose((0.0, 0.0, 0.0), quat))
    contacts = run(world, 1000)["box"]
    downhill = pybullet.rotateVector(quat, (1.0, 0.0, 0.0))
    speed = sum(a * b for a, b in zip(world.bodies["box"].base_twist().linear, downhill))
    if beyond_rad < 0.0:
        assert abs(speed) < 1e-3
        assert contacts.force == pytest.approx((0.0, 0.0, MASS_KG * GRAVITY), abs=0.01 * MASS_KG * GRAVITY)
    else:
        after_1_s = GRAVITY * (math.sin(angle) - friction * math.cos(angle))
        assert speed == pytest.approx(after_1_s, rel=0.1)


def test_forces_on_a_sliding_box_explain_its_deceleration(build):
    world = build(
        resting_box(
            half_extents_m=(0.2, 0.2, 0.05),
            basePosition=[0.0, 0.0, 0.05],
            changeDynamics={"lateralFriction": 0.3, "linearDamping": 0.0},
            resetBaseVelocity={"linearVelocity": [2.0, 1.0, 0.0]},
        )
    )
    run(world, 100)
    before = world.pb.getBaseVelocity(world.bodies["box"].body_id)[0]
    forces = [run(world, 1)["box"].force for _ in range(200)]
    after = world.pb.getBaseVelocity(world.bodies["box"].body_id)[0]
    mean = [sum(force[axis] for force in forces) / len(forces) for axis in range(3)]
    lost = [MASS_KG * (new - old) / 0.2 for old, new in zip(before, after)]
    assert mean == pytest.approx([lost[0], lost[1], lost[2] + MASS_KG * GRAVITY], rel=0.01)
    assert mean[0] == pytest.approx(2.0 * mean[1], rel=0.01)
    assert mean[0] < -4.0


def test_near_body_without_touch_is_no_contact(build):
    world = build(resting_box(height_m=0.11))
    assert run(world, 10)["box"].points == ()


def test_pybullet_is_asked_once_a_tick_for_all(build, monkeypatch):
    world = build(resting_box("a"), resting_box("b", 0.3), floor={**FLOOR, "contacts": TOLD})
    run(world, 100)
    asked = []
    original = world.pb.getContactPoints
    monkeypatch.setattr(world.pb, "getContactPoints", lambda *given: asked.append(given) or original(*given))
    run(world, 10)
    assert asked == [()] * 10


@pytest.mark.parametrize("field", range(5, 14))
def test_non_finite_contacts_are_refused_with_name_and_tick(build, monkeypatch, field):
    world = build(resting_box("a"), resting_box("b", 0.3), floor={**FLOOR, "contacts": TOLD})
    run(world, 10)
    original = world.pb.getContactPoints

    def spoilt() -> list[tuple]:
        value = math.nan if field in (8, 9, 10, 12) else (0.0, math.inf, 0.0)
        ends = {world.bodies["floor"].body_id, world.bodies["a"].body_id}
        return [
            touch[:field] + (value,) + touch[field + 1 :] if set(touch[1:3]) == ends else touch for touch in original()
        ]

    monkeypatch.setattr(world.pb, "getContactPoints", spoilt)
    world.set_sensor_rate("floor", 0, 0.0)
    world.set_sensor_rate("a", 0, 0.0)
    run(world, 1)  # those on the other box are sound
    world.set_sensor_rate("a", 0, 1000.0)
    with pytest.raises(PhysicsError, match="a: contacts are not finite any more at tick 12"):
        world.step()


def test_arrows_are_the_forces_to_scale(build):
    world = build(resting_box(contacts={"arrows_hz": 100, "arrow_metres_per_newton": 0.02}))
    arrows = [sample for _ in range(500) for sample in world.step() if isinstance(sample, ContactArrowsSample)]
    assert len(arrows) == 50
    heights = [end[2] - start[2] for start, end in arrows[-1].arrows]
    assert sum(heights) == pytest.approx(0.02 * MASS_KG * GRAVITY, rel=0.01)


def test_contacts_of_a_removed_body_disappear_at_once(build):
    world = build(resting_box("lower"), resting_box("upper", 0.3))
    run(world, 500)
    world.remove("upper")
    (lower,) = (sensor for sensor in world.sensors_of("lower") if sensor.sample_type is ContactsSample)
    assert {point.other_body for point in lower.read(world.clock.tick).points} == {"floor"}


def test_contacts_come_back_after_a_reset(build):
    world = build(resting_box())
    first = run(world, 300)["box"]
    world.reset()
    assert run(world, 300)["box"] == first


def test_contacts_are_off_by_default_and_refused_for_visual_robots(build):
    assert run(build(box(basePosition=[0.0, 0.0, 0.1])), 10) == {}
    robot = {"name": "ghost", "loadURDF": {"fileName": "kuka_iiwa/model.urdf"}, "is_visual_robot": True}
    with pytest.raises(ConfigError, match="contacts: a visual robot has no contacts"):
        load_object("visual_robot", {**robot, "contacts": {}}, "ghost.yaml")


def _sliding(told, hz):
    """Returns a box that slides over a plane, whose forces chatter, and then bumps into another."""
    speed = {"linearVelocity": [1.0, 0.3, 0.0]}
    boxes = resting_box(resetBaseVelocity=speed, contacts={**told, "hz": hz}), resting_box("other", 0.1)
    boxes[1]["basePosition"][0] = 0.27
    return boxes


def test_mean_contacts_contain_all_forces_between_two_samples(build):
    ticks, periods = 10, 20
    each, mean = build(*_sliding({}, 1000)), build(*_sliding({"average": True}, 100))
    for _ in range(periods):
        felt = [run(each, 1)["box"] for _ in range(ticks)]
        told = run(mean, ticks)["box"]
        assert {point[:3] for point in told.points} == {point[:3] for one in felt for point in one.points}
        for other in ("floor", "other"):
            points = [point for one in felt for point in one.points if point.other_body == other]
            means = [point for point in told.points if point.other_body == other]
            assert len(means) == bool(points)
            if points:
                force = [sum(point.force[axis] for point in points) / ticks for axis in range(3)]
                assert means[0].force == pytest.approx(force, abs=1e-9)
                pressed = sum(point.normal_force for point in points)
                assert means[0].normal_force == pytest.approx(pressed / ticks, rel=1e-6)
                moment = sum(point.normal_force * point.position[0] for point in points)
                assert pressed * means[0].position[0] == pytest.approx(moment, abs=1e-9) or not pressed
                assert math.hypot(*means[0].normal) == pytest.approx(1.0)
    assert each.state_hash() == mean.state_hash()


def test_mean_contacts_include_impacts_that_the_last_tick_misses(build):
    lost = {}
    for average in (False, True):
        dropped = resting_box("box", 0.2, contacts={"hz": 10, "average": average})
        world = build(dropped, floor=BOX_FLOOR)
        samples = [sample for _ in range(1000) for sample in world.step() if isinstance(sample, ContactsSample)]
        assert len(samples) == 10
        lost[average] = MASS_KG * GRAVITY - sum(sample.force[2] for sample in samples) / 10
    assert lost[True] == pytest.approx(0.0, abs=0.05)
    assert abs(lost[False]) > 1.0


def test_mean_contacts_cover_only_wanted_ticks_and_persist_when_paused(build):
    world = build(resting_box(contacts={"hz": 10, "average": True}))
    (sensor, _) = world.sensors_of("box")
    assert sensor.read(0).points == ()
    run(world, 500)
    first = sensor.read(world.clock.tick)
    assert first.force[2] == pytest.approx(MASS_KG * GRAVITY, rel=0.01) and sensor.read(world.clock.tick) is first
    for off in ({"wanted": False}, {"hz": 0.0}):
        sensor.wanted, sensor.hz = True, 10.0
        vars(sensor).update(off)
        world.bodies["box"].teleport(Pose((0.0, 0.0, 5.0)))
        run(world, 5)
        sensor.wanted, sensor.hz = True, 10.0
        assert sensor.read(world.clock.tick) is first, "nothing was kept"
