"""The schemas that editors check YAML with: they take what the models take, and refuse what people get wrong."""

from __future__ import annotations

import copy
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import worlds
import yaml
from jsonschema import Draft7Validator, RefResolver

from custom_ros_tools.errors import ConfigError
from custom_ros_tools.node_configs import NODE_CONFIGS
from custom_ros_tools.schema.json_schema import Schema, explained, json_schema, resolved
from rpbi.config.sensors import RgbdSensorConfig
from rpbi.world.loading import load_object, load_world, load_world_dict, type_of
from rpbi.world.schemas import kind_of, schemas, sections

SRC = Path(__file__).resolve().parents[4] / "src"
SCHEMAS = schemas()
BESIDE = "file:///"
STORE = {f"{BESIDE}{kind}.schema.json": schema for kind, schema in SCHEMAS.items()}
"""The files as they stand beside each other in a folder."""
PACKAGES = [path.parent for path in SRC.glob("*/configs") if path.parent.name != "operator_node"]
"""Packages with YAML files; mappings of operator_node have no schema."""
OF_ROS = {"controllers.yaml"}
"""Files of other packages' formats."""
SHIPPED = sorted(path for package in PACKAGES for path in package.glob("configs/**/*.yaml") if path.name not in OF_ROS)
MODELINE = re.compile(r"# yaml-language-server: \$schema=(\S+)")
SECTION = {"collision": "collision_objects", "dynamic": "dynamic_objects", "soft": "soft_objects", "robot": "robots"}
CAMERA: dict[str, Any] = {"name": "camera", "object_tf": {"tf_id": "rpbi/camera"}}
URDF = {"fileName": "kuka_iiwa/model.urdf"}
CLOTH: dict[str, Any] = {"name": "cloth", "loadSoftBody": {"fileName": "cloth_z_up.obj", "useMassSpring": True}}


def problems(kind: str, data: Any) -> list[str]:
    """Returns what a schema finds wrong with a file of a kind."""
    resolver = RefResolver(f"{BESIDE}{kind}.schema.json", SCHEMAS[kind], store=STORE)
    errors = list(Draft7Validator(SCHEMAS[kind], resolver=resolver).iter_errors(data))
    for error in errors:
        errors += error.context or ()  # what is wrong with each alternative
    return [f"{'.'.join(map(str, each.absolute_path))}: {each.message}" for each in errors]


def parse(kind: str, data: Any) -> None:
    """Validates a file of a kind the way a world does."""
    if kind == "world":
        load_world_dict(data, "world.yaml")
    elif kind == "rgbd_sensor":
        RgbdSensorConfig.parse(data, "camera.yaml")
    else:
        (section,) = (each for each in sections() if kind_of(each) == kind)
        load_object(type_of(section, data), data, "object.yaml")


@pytest.mark.parametrize("kind", SCHEMAS)
def test_schema_is_understood_by_editors(kind: str) -> None:
    for schema in (SCHEMAS[kind], explained(SCHEMAS[kind])):
        Draft7Validator.check_schema(schema)
        assert "draft-07" in schema["$schema"]


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: f"{path.parent.name}/{path.name}")
def test_shipped_file_names_its_schema_first_and_validates_against_it(path: Path) -> None:
    named = MODELINE.match(path.read_text())
    assert named, f"{path}: the first line should be '# yaml-language-server: $schema=PATH/KIND.schema.json'"
    schema = path.parent / named[1]
    assert schema.is_file(), f"{path}: there is no {named[1]}"
    assert faults(schema, yaml.safe_load(path.read_text())) == []


def faults(schema: Path, data: Any) -> list[str]:
    """Returns what a schema file finds wrong; files beside it are read where it refers to them."""
    content = json.loads(schema.read_text())
    validator = Draft7Validator(content, resolver=RefResolver(schema.as_uri(), content))
    return [each.message for each in validator.iter_errors(data)]


def mappings(data: Any) -> Iterator[dict[str, Any]]:
    """Yields all mappings inside of a file."""
    if isinstance(data, dict):
        yield data
        data = list(data.values())
    for each in data if isinstance(data, list) else ():
        yield from mappings(each)


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: f"{path.parent.name}/{path.name}")
def test_shipped_file_with_a_wrong_key_violates_its_schema(path: Path) -> None:
    named = MODELINE.match(path.read_text())
    assert named
    data = yaml.safe_load(path.read_text())
    sensors = [sensor for each in mappings(data) for sensor in each.get("sensors", ())]
    controllers = [
        one for each in mappings(data) for one in each.get("controllers", {}).values() if ":" in one.get("type", ":")
    ]
    of_others = {id(one) for entry in (*sensors, *controllers) for one in mappings(entry)}
    count = 0
    for mapping in mappings(data):
        if id(mapping) in of_others:  # a class of another package may have any keys
            continue
        mapping["no such key"] = "some text"
        assert faults(path.parent / named[1], data), f"nothing wrong with 'no such key' in {mapping}"
        del mapping["no such key"]
        count += 1
    assert count > 0


@pytest.mark.parametrize("path", sorted(SRC.glob("*/schema/*.json")), ids=lambda path: path.name)
def test_schema_references_only_itself_and_entries_of_neighbouring_files(path: Path) -> None:
    content = json.loads(path.read_text())
    resolver = RefResolver(path.as_uri(), content)
    for reference in {each["$ref"] for each in mappings(content) if isinstance(each.get("$ref"), str)}:
        file, _, place = reference.partition("#")
        assert not file or (path.name == "world.schema.json" and place == "/$defs/entry"), reference
        assert resolver.resolve(reference)[1], reference


def test_schema_of_the_main_file_is_small() -> None:
    assert (SRC / "ros_pybullet_interface/schema/world.schema.json").stat().st_size < 40_000


def test_shipped_files_name_the_schema_of_their_list() -> None:
    """A box that names the schema of robots would be told off by editors and accepted by the world."""
    worlds_shipped = [path for path in SHIPPED if "world.schema.json" in path.read_text()]
    assert worlds_shipped
    for path in worlds_shipped:
        main = yaml.safe_load(path.read_text())
        for section in sections():
            for entry in main.get(section, ()):
                file = entry["file"] if isinstance(entry, dict) else entry
                folder = SRC if file.startswith("{") else path.parent
                text = (folder / re.sub(r"\{(\w+)\}", r"\1", file)).read_text()
                assert f"/{kind_of(section)}.schema.json" in text.splitlines()[0], f"{file} is one of {section}"


def test_files_of_the_template_hold_the_schemas() -> None:
    root = SRC.parent / "docs/templates"
    main = yaml.safe_load((root / "my_robot_lab/configs/lab.yaml").read_text())
    assert problems("world", main) == []
    files = [(section, file) for section in sections() for file in main.get(section, ())]
    assert {"robots", "objects"} <= {section for section, _ in files}
    for section, file in files:
        data = yaml.safe_load((root / file.replace("{my_robot_lab}", "my_robot_lab")).read_text())
        assert problems(kind_of(section), data) == [], file


def test_worlds_of_tests_hold_the_schemas(tmp_path: Path) -> None:
    path = worlds.write_world(
        tmp_path,
        collision=(worlds.FLOOR,),
        dynamic=(worlds.box(), worlds.ball()),
        robots=(worlds.iiwa(),),
        rgbd_sensor=CAMERA,
    )
    load_world(path)
    main = yaml.safe_load(Path(path).read_text())
    assert problems("world", main) == []
    for section in ("collision_objects", "dynamic_objects", "robots"):
        for file in main[section]:
            assert problems(kind_of(section), yaml.safe_load((tmp_path / file).read_text())) == []


def without(data: dict[str, Any], key: str) -> dict[str, Any]:
    """Returns a mapping without one of its keys."""
    return {name: value for name, value in data.items() if name != key}


def keys(schema: Schema, root: Schema, path: str = "") -> Iterator[tuple[str, Schema]]:
    """Yields all keys in a schema, with their paths."""
    for key, value in schema.get("properties", {}).items():
        if isinstance(value, dict):
            yield f"{path}{key}", {**resolved(value, root), **value}
            yield from keys(resolved(value, root), root, f"{path}{key}.")
    alternatives = (*schema.get("anyOf", ()), *schema.get("allOf", ()))
    for inner in (*alternatives, schema.get("items"), schema.get("additionalProperties")):
        if isinstance(inner, dict) and inner.get("$ref", "#").startswith("#") and "properties" not in inner:
            yield from keys(resolved(inner, root), root, path)


ACCEPTED: list[tuple[str, Any]] = [
    ("world", {}),
    ("world", {"connect": {"connection_mode": 2}, "step_pybullet_manually": 1}),
    ("world", {"setAdditionalSearchPath": "pybullet_data_path", "clock_hz": None, "timeStep": 1}),
    ("world", {"setAdditionalSearchPath": ["pybullet_data_path"]}),
    ("world", {"configureDebugVisualizer": {"flag": "COV_ENABLE_GUI|COV_ENABLE_SHADOWS", "enable": 1}}),
    ("world", {"configureDebugVisualizer": {"flag": [1, "COV_ENABLE_SHADOWS"]}}),
    ("world", {"configureDebugVisualizer": {"flag": 1}}),
    ("world", {"gravity": -9.81, "visual_object": [], "setPhysicsEngineParameter": {"fixedTimeStep": 0.1}}),
    ("world", {"robots": [], "rgbd_sensor": None}),
    ("world", {"rgbd_sensor": CAMERA}),
    ("robot", worlds.iiwa(setJointMotorControlArray={"controlMode": 1, "positionGains": 0.1})),
    ("robot", worlds.iiwa(setJointMotorControlArray={"controlMode": "POSITION_CONTROL", "positionGains": [1] * 7})),
    ("robot", worlds.iiwa(setJointMotorControlArray={"controlMode": 2, "velocityGains": {"lbr_iiwa_joint_1": 1}})),
    ("robot", worlds.iiwa(setJointMotorControlArray={"controlMode": 2, "forces": [1, 2]})),
    ("robot", worlds.iiwa(enabled_joint_force_torque_sensors=["lbr_iiwa_joint_1", {"joint": "lbr_iiwa_joint_2"}])),
    ("robot", worlds.iiwa(enabled_joint_force_torque_sensors=[{"joint": "a", "noise_force_n": 1}])),
    ("robot", worlds.iiwa(enabled_joint_force_torque_sensors=[{"joint": "a", "noise_force_n": [0, 0, 1]}])),
    ("robot", worlds.iiwa(publish_joint_state_frequency=100, brodcast_link_states_frequency=30)),
    ("robot", worlds.iiwa(**{"self.broadcast_link_states_hz": 30, "object_tf": {"tf_id": "a", "offset": [0, 0, 1]}})),
    ("robot", worlds.iiwa(joint_trajectory_controller={"constraints": {"goal_time": 1, "joint_1": {"goal": 0.1}}})),
    ("robot", worlds.iiwa(loadURDF={**URDF, "flags": ["URDF_ENABLE_SLEEPING", 8]})),
    ("robot", worlds.iiwa(loadURDF={**URDF, "flags": "URDF_ENABLE_SLEEPING | URDF_ENABLE_WAKEUP"})),
    ("robot", worlds.iiwa(type="robot", base_state_hz=0, contacts={})),
    ("dynamic_object", worlds.box(basePosition=[0, 0, 1], baseOrientation=[0, 0, 0, 2], contacts=None)),
    ("soft_object", {**CLOTH, "createSoftBodyAnchor": [[0], [0, "box", "lid"], [0, -1, -1, [0, 0, 1]], [9, 0, "box"]]}),
    ("soft_object", {**CLOTH, "createSoftBodyAnchor": [{"node": 0, "body": "box", "link": 1}]}),
    ("rgbd_sensor", {**CAMERA, "intrinsics": {"range": [0.1, 3]}, "pointcloud": 0}),
]


@pytest.mark.parametrize(("kind", "data"), ACCEPTED, ids=lambda value: value if isinstance(value, str) else "")
def test_schema_accepts_files_that_a_world_accepts(kind: str, data: Any) -> None:
    parse(kind, data)
    assert problems(kind, data) == []


BASES: dict[str, dict[str, Any]] = {
    "world": {"rgbd_sensor": CAMERA},
    "visual_object": without(worlds.FLOOR, "changeDynamics"),
    "collision_object": worlds.FLOOR,
    "dynamic_object": worlds.box(),
    "robot": worlds.iiwa(enabled_joint_force_torque_sensors=[{"joint": "a"}]),
    "urdf": {"name": "cup", "loadURDF": {"fileName": "cube.urdf"}},
    "soft_object": CLOTH,
    "rgbd_sensor": CAMERA,
}
"""A file of each kind that is fine."""
VALUES = (
    *(None, True, False, 0, 1, -1, 2, 7, 0.5, 1e9, "", "text", "a/b", "kuka_iiwa/model.urdf", "GEOM_BOX", "GUI"),
    *("URDF_ENABLE_SLEEPING", "URDF_ENABLE_SLEEPING|URDF_ENABLE_WAKEUP", "COV_ENABLE_GUI", [], {}, {"a": 1}),
    *([1], [0.1, 1], [1, 2, 3], [0.5] * 4, ["text"], ["COV_ENABLE_GUI"], [[0.1, 2, 3]]),
    *([{"joint": "a"}], {"a": {"goal": 1}}),
)


@pytest.mark.parametrize("kind", BASES)
def test_schema_accepts_every_value_that_a_world_accepts(kind: str, caplog: pytest.LogCaptureFixture) -> None:
    base = BASES[kind]
    refused, taken = [], 0
    for path in [path for path, _ in keys(SCHEMAS[kind], SCHEMAS[kind]) if not path.startswith(tuple(sections()))]:
        for value in VALUES:
            data = copy.deepcopy(base)
            *outer, key = path.split(".") if path not in SCHEMAS[kind]["properties"] else [path]
            place: Any = data
            for each in outer:
                place = place.setdefault(each, {})
                place = place[0] if isinstance(place, list) else place
            place[key] = value
            try:
                parse(kind, data)
            except ConfigError:
                continue
            taken += 1
            refused += [(path, value)] if problems(kind, data) else []
    assert refused == []
    assert taken > 20


REFUSED: list[tuple[str, Any, str]] = [
    ("world", {"timestep": 0.01}, "timestep"),
    ("world", {"timeStep": 0}, "timeStep"),
    ("world", {"timeStep": "0.01"}, "timeStep"),
    ("world", {"status_hz": -1}, "status_hz"),
    ("world", {"connect": {"connection_mode": "GUY"}}, "connection_mode"),
    ("world", {"connect": {"mode": "GUI"}}, "mode"),
    ("world", {"robots": "arm.yaml"}, "robots"),
    ("world", {"robots": [3]}, "robots"),
    ("world", {"robots": [{"name": "arm"}]}, "robots"),
    ("world", {"rgbd_sensor": {"name": "camera"}}, "object_tf"),
    ("world", {"enable_mouse_publisher": "yes"}, "enable_mouse_publisher"),
    ("robot", without(worlds.iiwa(), "name"), "name"),
    ("robot", worlds.iiwa(name="left arm"), "name"),
    ("robot", worlds.iiwa(joint_state_publisher_hz=-50), "joint_state_publisher_hz"),
    ("robot", worlds.iiwa(joint_state_publisher_hz=[50]), "joint_state_publisher_hz"),
    ("robot", worlds.iiwa(publish_joint_state_frequency=-1), "publish_joint_state_frequency"),
    ("robot", worlds.iiwa(initial_joint_position=[0, 1]), "initial_joint_position"),
    ("robot", worlds.iiwa(initial_joint_position={"lbr_iiwa_joint_1": "zero"}), "initial_joint_position"),
    ("robot", worlds.iiwa(color_alpha=1.5), "color_alpha"),
    ("robot", worlds.iiwa(setJointMotorControlArray={"controlMode": "POSITION"}), "controlMode"),
    ("robot", worlds.iiwa(loadURDF={**URDF, "basePosition": [0, 0]}), "basePosition"),
    ("robot", worlds.iiwa(joint_trajectory_controller={"constraints": {"goal_tim": 1}}), "goal_tim"),
    ("dynamic_object", without(worlds.box(), "baseMass"), "baseMass"),
    ("dynamic_object", worlds.box(baseMass=0), "baseMass"),
    ("dynamic_object", worlds.box(mass=1), "mass"),
    ("dynamic_object", worlds.box(createVisualShape={"shapeType": "BOX"}), "shapeType"),
    ("dynamic_object", worlds.box(changeDynamics={"lateralFriction": -0.1}), "lateralFriction"),
    ("dynamic_object", worlds.box(changeDynamics={"lateral_friction": 0.1}), "lateral_friction"),
    ("collision_object", {**worlds.FLOOR, "object_tf": {"tf_id": "/floor"}}, "tf_id"),
    ("soft_object", {**CLOTH, "createSoftBodyAnchor": [[]]}, "createSoftBodyAnchor"),
    ("rgbd_sensor", {**CAMERA, "intrinsics": {"fov": 180}}, "fov"),
    ("rgbd_sensor", {**CAMERA, "intrinsics": {"range": [0.1]}}, "range"),
]


@pytest.mark.parametrize(("kind", "data", "key"), REFUSED, ids=[f"{kind}-{key}" for kind, _, key in REFUSED])
def test_a_mistake_is_found_by_schema_and_world_alike(kind: str, data: Any, key: str) -> None:
    with pytest.raises(ConfigError, match=key):
        parse(kind, data)
    assert any(key in fault for fault in problems(kind, data)), problems(kind, data)


def test_entry_accepts_only_keys_of_its_file() -> None:
    arms = [{"file": "iiwa.yaml", "name": "left", "loadURDF": {"basePosition": [0, 0, 1]}}, "iiwa.yaml"]
    assert problems("world", {"robots": arms}) == []
    assert problems("world", {"robots": [{"file": "iiwa.yaml", "nmae": "left"}]})
    assert problems("world", {"robots": [{"file": "iiwa.yaml", "loadURDF": {"basePosition": [0, 1]}}]})
    assert problems("robot", worlds.iiwa(file="iiwa.yaml")), "'file' is a key of entries only"


def test_entry_requires_keys_of_list_items_but_not_of_mappings() -> None:
    for overrides in ({"loadURDF": {"flags": 0}}, {"object_tf": {"hz": 5}}, {"setJointMotorControlArray": {}}):
        assert problems("world", {"robots": [{"file": "iiwa.yaml", **overrides}]}) == []
        is_complete = "object_tf" in overrides  # which then follows nothing
        assert bool(problems("robot", {**worlds.iiwa(), **overrides})) is not is_complete
    for overrides in ({"sensors": [{"name": "a"}]}, {"enabled_joint_force_torque_sensors": [{"hz": 5}]}):
        assert problems("world", {"robots": [{"file": "iiwa.yaml", **overrides}]})


def test_objects_of_own_types_may_have_unknown_keys() -> None:
    own = {"type": "my_lab.conveyor:Conveyor", "name": "belt", "speed": 1.0}
    assert problems("object", own) == []
    assert problems("world", {"objects": ["belt.yaml", {"file": "belt.yaml", "name": "slow", "speed": 0.1}]}) == []
    assert problems("object", without(own, "type"))
    assert problems("object", {**own, "type": "Conveyor"})


def test_old_keys_are_deprecated_and_name_their_replacement() -> None:
    old = SCHEMAS["robot"]["properties"]["publish_joint_state_frequency"]
    assert old["deprecated"] is True
    assert "write joint_state_publisher_hz" in old["deprecationMessage"]
    assert SCHEMAS["world"]["properties"]["setPhysicsEngineParameter"]["properties"]["fixedTimeStep"]["deprecated"]
    assert problems("rgbd_sensor", {**CAMERA, "object_tf": {"tf_id": "a", "offset": [0, 0, 1]}}), "no old key there"


ALL = {**SCHEMAS, **{node: json_schema(model, node) for node, model in NODE_CONFIGS.items()}}


@pytest.mark.parametrize("kind", ALL)
def test_every_key_has_a_description_and_a_valid_default(kind: str) -> None:
    for path, schema in keys(ALL[kind], ALL[kind]):
        assert schema.get("description", "").endswith("."), path
        if "default" in schema:
            validator = Draft7Validator(schema, resolver=RefResolver("", ALL[kind]))
            assert list(validator.iter_errors(schema["default"])) == [], path


def test_description_for_editors_includes_unit_and_default() -> None:
    shown = explained(SCHEMAS["robot"])["properties"]["target_timeout_s"]["description"]
    assert shown.endswith("[s] Default: 0.5.")
