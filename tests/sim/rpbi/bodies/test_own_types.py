"""Types of objects and sensors that another package has, named in YAML by `module:Class`."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml
from worlds import FLOOR, box, write_world

from custom_ros_tools import plugins
from custom_ros_tools.errors import ConfigError, PluginError
from rpbi.bodies import BODY_TYPES
from rpbi.world import World
from rpbi.world.loading import load_object
from rpbi.world.saved.description import WorldDescription
from rpbi.world.saved.values import from_text, to_text

TEMPLATES = Path(__file__).resolve().parents[4] / "docs/templates"
CONVEYOR, RANGE_FINDER = "my_robot_lab.conveyor:Conveyor", "my_robot_lab.range_finder:RangeFinder"
BELT = {"name": "belt", "type": CONVEYOR, "size": [4.0, 0.5, 0.1], "position": [0.0, 0.0, 0.3], "speed": 0.2}
EYE = {"name": "eye", "type": RANGE_FINDER, "hz": 100.0, "max_range": 2.0}
DOWN = {**EYE, "name": "down", "position": [0.0, 0.0, -0.11], "direction": [0.0, 0.0, -1.0]}
UP = {**EYE, "name": "up", "position": [0.0, 0.0, 0.11], "direction": [0.0, 0.0, 2.0]}


@pytest.fixture(autouse=True)
def lab(monkeypatch):
    monkeypatch.syspath_prepend(TEMPLATES / "my_robot_lab" / "src")


def build(folder, *own, **parts):
    path = write_world(folder, collision=(FLOOR,), **parts)
    main = yaml.safe_load(Path(path).read_text())
    for thing in own:
        (folder / f"{thing['name']}.yaml").write_text(yaml.safe_dump(thing))
    main["objects"] = [f"{thing['name']}.yaml" for thing in own]
    Path(path).write_text(yaml.safe_dump(main))
    return World.from_file(path)


@pytest.fixture
def world(tmp_path):
    parcel = box("parcel", basePosition=[-1.0, 0.0, 0.45], changeDynamics={"lateralFriction": 0.8})
    world = build(tmp_path, BELT, dynamic=(parcel,))
    yield world
    world.close()


def run(world, ticks):
    return [sample for _ in range(ticks) for sample in world.step()]


def add(world, kind, **keys):
    return world.add(kind, load_object(kind, keys, "own.yaml"))


def thing(**keys):
    return {"name": "thing", "type": "faulty_lab:Thing", **keys}


def gauge(kind, **keys):
    return {"name": "gauge", "type": f"faulty_lab:{kind}", "hz": 100.0, **keys}


def test_an_object_of_an_own_type_acts_on_others(world):
    run(world, 500)
    start = world.bodies["parcel"].base_pose().position[0]
    run(world, 1000)
    assert world.bodies["parcel"].base_pose().position[0] - start == pytest.approx(0.2, abs=0.005)
    assert BODY_TYPES.name_of(world.bodies["belt"]) == CONVEYOR


def test_states_of_own_types_need_trust_in_another_process(world, monkeypatch):
    run(world, 5)
    state = world.save()
    world.restore(state)
    World.from_state(state).close()
    monkeypatch.setattr(plugins, "_used", set())  # as in another process
    with pytest.raises(ConfigError, match=f"'{CONVEYOR}' is not trusted"):
        World.from_state(state)
    World.from_state(state, trust=["my_robot_lab"]).close()
    World.from_state(state, trust=None).close()


def test_own_types_come_after_rigid_bodies_and_before_soft_ones(tmp_path):
    with pytest.raises(ConfigError) as caught:
        build(tmp_path, {**BELT, "size": 1}, soft=({"name": "soft"},), robots=({"name": "robot"},))
    files = dict.fromkeys(problem.file for problem in caught.value.problems)
    assert list(files) == ["robot.yaml", "belt.yaml", "soft.yaml"]


def test_object_may_name_a_built_in_type(tmp_path):
    world = build(tmp_path, {**box("crate", basePosition=[0.0, 0.0, 1.0]), "type": "dynamic"})
    assert BODY_TYPES.name_of(world.bodies["crate"]) == "dynamic"
    world.close()


def test_a_type_of_the_interface_may_be_extended(tmp_path):
    balloon = {**box("balloon", basePosition=[0.0, 0.0, 1.0]), "type": "faulty_lab:Balloon"}
    world = build(tmp_path, dynamic=(balloon,))
    run(world, 500)
    assert world.bodies["balloon"].base_pose().position[2] > 1.5
    world.close()


def test_sensor_of_an_own_type_works_on_any_body(tmp_path):
    falling = box("falling", basePosition=[0.0, 0.0, 1.0], sensors=[DOWN, UP])
    world = build(tmp_path, dynamic=(falling,))
    samples = {sample.name: sample for sample in run(world, 10)}
    height = world.bodies["falling"].base_pose().position[2]
    assert samples["falling/down"].distance == pytest.approx(height - 0.11, abs=1e-6)
    assert samples["falling/up"].distance is None
    world.close()


def test_reset_world_is_bitwise_identical_to_a_fresh_one(world, tmp_path):
    run(world, 700)
    add(world, CONVEYOR, name="visitor", size=[1, 1, 1], position=[0, 3, 1])
    world.put("belt/speed", -1.0)
    run(world, 300)
    world.reset()
    run(world, 1000)
    fresh = World.from_file(str(tmp_path / "world.yaml"))
    run(fresh, 1000)
    assert list(world.bodies) == list(fresh.bodies)
    assert world.state_hash() == fresh.state_hash()
    fresh.close()


def test_world_with_own_types_can_be_recorded(world):
    again = World.from_description(WorldDescription(world.describe()))
    config = load_object(CONVEYOR, {**BELT, "name": "second", "sensors": [EYE]}, "second.yaml")
    for each, given in ((world, config), (again, from_text(to_text(config)))):
        run(each, 300)
        each.add(CONVEYOR, given)
        each.put("belt/speed", 0.5)
    assert run(world, 300) == run(again, 300)
    assert world.state_hash() == again.state_hash()
    again.close()


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({"name": "a"}, r"a.yaml: type: expected 'module:Class', or one of visual, collision, "),
        ({"name": "a", "type": 3}, r"a.yaml: type: unknown object type '3'"),
        ({"name": "a", "type": "dynamik"}, r"a.yaml: type: unknown object type 'dynamik'; did you mean 'dynamic'"),
        ({"name": "a", "type": "faulty lab:Thing"}, r"a.yaml: type: expected a name like 'my_package.my_module:"),
        (
            {"name": "a", "type": "no_lab.conveyor:Conveyor"},
            r"a.yaml: type: no module 'no_lab': is its package built, and its workspace sourced\?",
        ),
        (
            {"name": "a", "type": "my_robot_lab.conveyer:Conveyor"},
            r"a.yaml: type: 'my_robot_lab' has no module 'conveyer'; did you mean 'conveyor'\?",
        ),
        (
            {"name": "a", "type": "my_robot_lab.conveyor:Conveyer"},
            r"a.yaml: type: 'my_robot_lab.conveyor' has no 'Conveyer'; did you mean 'Conveyor'\?",
        ),
        ({"name": "a", "type": RANGE_FINDER}, r"a.yaml: type: expected a subclass of rpbi.bodies.body:Body, got 'my_"),
        ({"name": "a", "type": "faulty_lab:NOT_A_CLASS"}, r"a.yaml: type: expected a subclass of rpbi.bodies.body:B"),
        ({**BELT, "sped": 1.0}, r"belt.yaml: sped: unknown key 'sped'; did you mean 'speed'\?"),
        ({**BELT, "speed": "fast"}, r"belt.yaml: speed: expected a number \[m/s\], got text 'fast'"),
        (thing(sensors=3), r"thing.yaml: sensors: expected a list of sensors"),
        (thing(sensors=["eye"]), r"thing.yaml: sensors\[0\]: expected a mapping with 'type: module:Class'"),
        (
            thing(sensors=[{**EYE, "type": "contacts"}]),
            r"sensors\[0\].type: expected a name like 'my_package.my_module:",
        ),
        (thing(sensors=[{**EYE, "type": "nowhere:Eye"}]), r"thing.yaml: sensors\[0\].type: no module 'nowhere'"),
        (
            thing(sensors=[{**EYE, "type": CONVEYOR}]),
            r"sensors\[0\].type: expected a subclass of rpbi.sensors.sensor:BodySensor, got 'my_robot_lab.c",
        ),
        (thing(sensors=[gauge("NoConfig")]), r"sensors\[0\].type: expected a Config in 'faulty_lab:NoConfig' that is"),
        (thing(sensors=[{**EYE, "hz": 0}]), r"thing.yaml: sensors\[0\].hz: must be > 0 \[Hz\], got 0"),
        (thing(sensors=[{**EYE, "max_rang": 1}]), r"sensors\[0\].max_rang: unknown key 'max_rang'; did"),
        (thing(sensors=[{**EYE, "direction": [0, 0, 0]}]), r"sensors\[0\].direction: a direction cannot be all zeros"),
        (thing(sensors=[EYE, EYE]), r"thing.yaml: sensors\[1\].name: 'eye' is the name of another sensor"),
        (thing(fails="init"), r"thing.yaml: faulty_lab:Thing failed in making 'thing': KeyError: 'no such key' \(.*f"),
        (thing(fails="sensors"), r"faulty_lab:Thing failed in sensors and inputs of 'thing': RuntimeError: no sensors"),
        (thing(sensors=[gauge("RefusingGauge")]), r"thing.yaml: sensors: needs a body with joints"),
        (thing(sensors=[gauge("UnmadeGauge")]), r"faulty_lab:UnmadeGauge failed in making 'thing/gauge': OSError: no"),
    ],
)
def test_mistake_is_reported_with_file_and_key(tmp_path, data, message):
    with pytest.raises(ConfigError, match=message):
        build(tmp_path, data)


def test_all_problems_are_reported_at_once(tmp_path):
    wrong = {**BELT, "size": 1, "sensors": [{**EYE, "hz": -1, "max_range": "far"}, {"type": "nowhere:X"}]}
    with pytest.raises(ConfigError) as caught:
        build(tmp_path, wrong, {"name": "other", "type": "nowhere:Y"})
    keys = {(problem.file, problem.key) for problem in caught.value.problems}
    of_belt = ("size", "sensors[0].hz", "sensors[0].max_range", "sensors[1].type")
    assert keys == {*(("belt.yaml", key) for key in of_belt), ("other.yaml", "type")}


@pytest.mark.parametrize("keys", [{"fails": "init"}, {"fails": "sensors"}, {"sensors": [gauge("UnmadeGauge")]}])
def test_a_failing_add_leaves_the_world_as_it_was(world, keys):
    run(world, 10)
    before = world.state_hash(), list(world.bodies), world.commands.count, world.pb.getNumBodies()
    with pytest.raises(PluginError, match="faulty_lab:"):
        add(world, "faulty_lab:Thing", name="thing", **keys)
    assert (world.state_hash(), list(world.bodies), world.commands.count, world.pb.getNumBodies()) == before
    add(world, "faulty_lab:Thing", name="thing")  # its name is free
    run(world, 10)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"fails": "before_step"}, r"Thing failed in before_step of 'thing' at tick 5: ZeroDivisionError: division by"),
        ({"fails": "pybullet"}, r"Thing failed in before_step of 'thing' at tick 0: error: .*_lab.py, line \d+\)"),
        ({"sensors": [gauge("BrokenGauge")]}, r"BrokenGauge failed in read of 'thing/gauge' at tick 10: IndexError"),
        ({"sensors": [gauge("NanGauge")]}, r"NanGauge failed in .*: the sample has a number that is not finite: .*nan"),
        ({"sensors": [gauge("OddGauge")]}, r"OddGauge failed in .*: expected a Number, as sample_type says; got 3.0"),
        ({"sensors": [gauge("MisnamedGauge")]}, r"MisnamedGauge failed in .*: expected the sensor's name 'thing/gau"),
    ],
)
def test_class_failing_in_a_tick_is_named_with_its_file(tmp_path, keys, message):
    world = build(tmp_path, thing(**keys))
    with pytest.raises(PluginError, match=f"^faulty_lab:{message}"):
        run(world, 20)
    world.close()


def test_a_sensor_that_only_looks_after_each_tick_does(tmp_path):
    world = build(tmp_path, thing(sensors=[gauge("WatchingGauge", hz=10.0)]))
    samples = run(world, 100)
    assert [sample.values for sample in samples] == [(100.0,)]
    world.close()


def test_an_input_that_fails_is_named(tmp_path):
    world = build(tmp_path, thing(takes="push"))
    world.put("thing/push", 3.0)
    with pytest.raises(PluginError, match="^faulty_lab:Thing failed in applying 'thing/push' at tick 0: RuntimeErr"):
        world.step()
    world.close()


def test_sensor_of_an_own_type_is_read_at_its_rate(tmp_path):
    world = build(tmp_path, thing(sensors=[gauge("Gauge", hz=250.0)]))
    samples = run(world, 1000)
    assert len(samples) == 250 and samples[0].values == (1.0, 2.0)
    world.close()
