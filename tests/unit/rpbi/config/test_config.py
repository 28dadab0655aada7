"""A world is read from all of its files, and all problems of all files are told at once."""

from __future__ import annotations

import copy
import logging
import pickle
from pathlib import Path
from typing import Any

import pybullet
import pybullet_data
import pytest
import yaml

from custom_ros_tools.errors import ConfigError
from rpbi.config.world import WorldConfig, main_file_model
from rpbi.world.loading import LoadedWorld, load_object, load_world, load_world_dict
from rpbi.world.objects import object_sections

BALL: dict[str, Any] = {"name": "ball", "createVisualShape": {"shapeType": "GEOM_SPHERE", "radius": 0.1}}
ARM: dict[str, Any] = {
    "name": "arm",
    "loadURDF": {"fileName": "kuka_iiwa/model.urdf"},
    "setJointMotorControlArray": {"controlMode": "POSITION_CONTROL"},
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with a ball and an arm in it."""
    write(tmp_path / "ball.yaml", BALL)
    write(tmp_path / "arm.yaml", ARM)
    return tmp_path


def write(path: Path, data: Any) -> str:
    """Writes data as YAML and returns the path."""
    path.write_text(yaml.safe_dump(data, sort_keys=False))
    return str(path)


def load(folder: Path, **main: Any) -> LoadedWorld:
    """Loads a world with this main file."""
    return load_world(write(folder / "world.yaml", main))


def problems(folder: Path, **main: Any) -> list[str]:
    """Returns the problems of a world with this main file; the folder is left out."""
    with pytest.raises(ConfigError) as caught:
        load(folder, **main)
    return [str(problem).replace(f"{folder}/", "") for problem in caught.value.problems]


def test_empty_main_file_is_a_world_with_the_documented_defaults(folder: Path) -> None:
    config = load(folder).config
    assert config.connect.connection_mode == pybullet.GUI
    assert config.setGravity.kwargs() == {"gravX": 0.0, "gravY": 0.0, "gravZ": 0.0}
    assert (config.timeStep, config.status_hz, config.real_time_factor) == (0.02, 50.0, 1.0)
    assert config.start_pybullet_after_initialization
    assert config.resetSimulation.kwargs() == config.setPhysicsEngineParameter.kwargs() == {}
    assert config.setAdditionalSearchPath == ()


def test_objects_come_in_the_order_of_types_then_of_files(folder: Path) -> None:
    write(folder / "other.yaml", {**BALL, "name": "other"})
    world = load(folder, robots=["arm.yaml"], visual_objects=["other.yaml", "ball.yaml"])
    assert [(item.type, item.config.name, item.file) for item in world.objects] == [  # type: ignore[attr-defined]
        ("visual", "other", "other.yaml"),
        ("visual", "ball", "ball.yaml"),
        ("robot", "arm", "arm.yaml"),
    ]


def test_files_named_by_an_object_become_absolute(folder: Path) -> None:
    (folder / "meshes").mkdir()
    (folder / "meshes" / "cube.obj").write_text("")
    mesh = {"shapeType": "GEOM_MESH", "fileName": "meshes/cube.obj"}
    write(folder / "ball.yaml", {"name": "ball", "createVisualShape": mesh})
    shape = load(folder, visual_objects=["ball.yaml"]).objects[0].config.createVisualShape  # type: ignore[attr-defined]
    assert shape.fileName == f"{folder}/meshes/cube.obj"


def test_file_search_order_is_yaml_folder_search_paths_pybullet_data(folder: Path) -> None:
    def found() -> str:
        world = load(folder, robots=["arm.yaml"], setAdditionalSearchPath="more")
        return str(world.objects[0].config.loadURDF.fileName)  # type: ignore[attr-defined]

    (folder / "more" / "kuka_iiwa").mkdir(parents=True)
    assert found() == f"{pybullet_data.getDataPath()}/kuka_iiwa/model.urdf"
    (folder / "more" / "kuka_iiwa" / "model.urdf").write_text("")
    assert found() == f"{folder}/more/kuka_iiwa/model.urdf"
    (folder / "kuka_iiwa").mkdir()
    (folder / "kuka_iiwa" / "model.urdf").write_text("")
    assert found() == f"{folder}/kuka_iiwa/model.urdf"


def test_search_path_may_be_pybullets_data(folder: Path) -> None:
    world = load(folder, setAdditionalSearchPath=["pybullet_data_path", str(folder)])
    assert world.config.setAdditionalSearchPath == (pybullet_data.getDataPath(), str(folder))


def test_robot_description_is_replaced_once_a_file_is_given(folder: Path) -> None:
    write(folder / "arm.yaml", {**ARM, "loadURDF": {"fileName": "robot_description"}})
    main = write(folder / "world.yaml", {"robots": ["arm.yaml"]})
    for file, expected in ((None, "robot_description"), ("/tmp/described.urdf", "/tmp/described.urdf")):
        world = load_world(main, robot_description=file)
        assert world.objects[0].config.loadURDF.fileName == expected  # type: ignore[attr-defined]


def test_faults_of_all_files_are_reported_at_once(folder: Path) -> None:
    write(folder / "arm.yaml", {**ARM, "loadURDF": {"fileName": "none.urdf"}, "joint_state_publisher_hz": -1})
    shape = {**BALL["createVisualShape"], "radius": float("nan"), "raduis": 1}
    write(folder / "ball.yaml", {**BALL, "createVisualShape": shape})
    write(folder / "twin.yaml", {"name": "arm", "createVisualShape": {"shapeType": "GEOM_BX"}})
    (folder / "broken.yaml").write_text("name: [\n")
    data = pybullet_data.getDataPath()
    assert problems(
        folder,
        setGravty={"gravZ": -9.81},
        timeStep="1e-3",
        connect={"connection_mode": "GIU"},
        visual_objects=["ball.yaml", "twin.yaml", "broken.yaml", "missing.yaml", 3],
        robots=["arm.yaml"],
        rgbd_sensor={"name": "ball", "hz": -1, "object_tf": {}},
    ) == [
        "world.yaml: connect.connection_mode: unknown connection mode 'GIU'; did you mean 'GUI'?",
        "world.yaml: timeStep: expected a number [s], got text '1e-3': YAML reads 1e-3 as text: write 1.0e-3",
        "world.yaml: rgbd_sensor.hz: must be > 0 [Hz], got -1",
        "world.yaml: rgbd_sensor.object_tf.tf_id: missing, expected a TF frame",
        "world.yaml: visual_objects[4]: expected a file name, or a mapping with 'file' and the keys that differ; got 3",
        "world.yaml: setGravty: unknown key 'setGravty'; did you mean 'setGravity'?",
        "ball.yaml: createVisualShape.radius: must be a finite number [m], got .nan",
        "ball.yaml: createVisualShape.raduis: unknown key 'raduis'; did you mean 'radius'?",
        "twin.yaml: createVisualShape.shapeType: unknown shape type 'GEOM_BX'; did you mean 'GEOM_BOX'?",
        "broken.yaml: line 2, column 1: expected the node content, but found '<stream end>'",
        f"world.yaml: visual_objects[3]: no such file: missing.yaml (looked in {folder}, {data})",
        "arm.yaml: name: 'arm' is taken by twin.yaml; names are unique in a world",
        f"arm.yaml: loadURDF.fileName: no such file: none.urdf (looked in {folder}, {data})",
        "arm.yaml: joint_state_publisher_hz: must be >= 0 [Hz], got -1",
        "world.yaml: rgbd_sensor.name: 'ball' is taken by ball.yaml; names are unique in a world",
    ]


@pytest.mark.parametrize(
    ("main", "told"),
    [
        ({"timeStep": 0}, "timeStep: must be > 0 [s], got 0"),
        ({"timeStep": 1e-12}, "timeStep: must be at least 1.0e-9 [s], got 1e-12"),
        ({"timeStep": 1e300}, "timeStep: must be at most 10 [s], got 1e+300"),
        ({"visualizer_image_width": 10**12}, "visualizer_image_width: must be <= 8192 [px], got 1000000000000"),
        ({"real_time_factor": -1}, "real_time_factor: must be >= 0, got -1"),
        ({"robots": "arm.yaml"}, "robots: expected a list of files, got text 'arm.yaml'"),
        ({"robots": None}, "robots: expected a list of files, got nothing"),
        ({"config": {"timeStep": 0.01}}, "config: unknown key 'config'; known are "),
        ({"setAdditionalSearchPath": "none"}, "setAdditionalSearchPath: no such folder: none"),
        (
            {"setPhysicsEngineParameter": {"jointFeedbackMode": "IN_JOINT_FRAME"}},
            "setPhysicsEngineParameter.jointFeedbackMode: unknown joint feedback mode 'IN_JOINT_FRAME'; "
            "did you mean 'JOINT_FEEDBACK_IN_JOINT_FRAME'?",
        ),
        (
            {"rgbd_sensor": {"name": "c", "object_tf": {"tf_id": "c"}, "intrinsics": {"range": [1, 0.1]}}},
            "rgbd_sensor.intrinsics.range: expected [near, far] with near < far [m], got [1, 0.1]",
        ),
        (
            {
                "rgbd_sensor": {
                    "name": "c",
                    "object_tf": {"tf_id": "c"},
                    "intrinsics": {"fov": 180, "width": 0},
                }
            },
            "rgbd_sensor.intrinsics.width: must be > 0 [px], got 0",
        ),
    ],
)
def test_wrong_value_in_the_main_file_is_reported(folder: Path, main: dict[str, Any], told: str) -> None:
    assert problems(folder, **main)[0].startswith(f"world.yaml: {told}")


def test_frames_of_the_world_and_of_objects_cannot_clash(folder: Path) -> None:
    write(folder / "ball.yaml", {**BALL, "name": "world"})
    assert problems(folder, visual_objects=["ball.yaml"]) == ["ball.yaml: name: 'world' is reserved"]


def test_same_file_twice_is_a_name_taken(folder: Path) -> None:
    assert problems(folder, visual_objects=["ball.yaml", "ball.yaml"]) == [
        "ball.yaml: name: 'ball' is taken by ball.yaml; names are unique in a world"
    ]


def test_world_from_the_parameter_server_has_no_file_name() -> None:
    with pytest.raises(ConfigError) as caught:
        load_world_dict({"timeStep": 0, "robots": ["{zebra_robot}/a.yaml"]}, "~config")
    first, second = map(str, caught.value.problems)
    assert first == "~config: timeStep: must be > 0 [s], got 0"
    assert second.startswith("~config: robots[0]: unknown ROS package 'zebra_robot'")


def test_parameter_that_is_no_mapping_is_refused() -> None:
    with pytest.raises(ConfigError, match="^~config: expected a mapping of keys to values, got str$"):
        load_world_dict("text", "~config")  # type: ignore[arg-type]


def test_missing_main_file_is_reported(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=f"^{tmp_path}/none.yaml: no such file or directory$"):
        load_world(f"{tmp_path}/none.yaml")


def test_main_mapping_is_not_changed(folder: Path) -> None:
    data = {
        "gravity": -9.81,
        "visual_objects": [],
        "setGravity": {"gravZ": -9.81},
        "robots": [f"{folder}/arm.yaml"],
    }
    before = copy.deepcopy(data)
    load_world_dict(data, "~config")
    assert data == before


def test_manual_stepping_is_accepted_without_effect(folder: Path, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO):
        load(folder, step_pybullet_manually=True)
    assert "step_pybullet_manually: has no effect" in caplog.text
    assert caplog.records[0].levelno == logging.INFO


def test_loaded_world_survives_pickling(folder: Path) -> None:
    world = load(folder, robots=["arm.yaml"], setPhysicsEngineParameter={"erp": 0.2})
    again = pickle.loads(pickle.dumps(world))
    assert again == world
    assert again.config.setPhysicsEngineParameter.kwargs() == {"erp": 0.2}


def test_single_object_is_checked_like_one_of_the_world(tmp_path: Path) -> None:
    data = {**ARM, "name": "world", "joint_state_publisher_hz": "fast"}
    with pytest.raises(ConfigError) as caught:
        load_object("robot", data, "config")
    assert str(caught.value) == (
        "config: name: 'world' is reserved\nconfig: joint_state_publisher_hz: expected a number [Hz], got text 'fast'"
    )


def test_unknown_type_of_object_is_named() -> None:
    with pytest.raises(ConfigError, match="config: type: unknown object type 'robt'; did you mean 'robot'?"):
        load_object("robt", ARM, "config")


def test_lists_of_files_in_an_older_recorded_world_are_ignored() -> None:
    assert WorldConfig.model_validate({"timeStep": 0.01, "robots": ["arm.yaml"]}) == WorldConfig(timeStep=0.01)


def test_every_key_of_the_main_file_has_description_and_schema() -> None:
    whole = main_file_model(object_sections()).model_json_schema()
    assert {"robots", "objects", "rgbd_sensors", "timeStep"} <= set(whole["properties"])
    for key, schema in whole["properties"].items():
        model = whole["$defs"].get(schema.get("$ref", "").rsplit("/", 1)[-1], {})
        assert schema.get("description", model.get("description", "")).endswith("."), key
