"""The models of PyBullet's functions agree with it, and find wrong values before it is called."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pybullet
import pybullet_data
import pytest

from custom_ros_tools.errors import ConfigError
from custom_ros_tools.schema.json_schema import Schema, json_schema, types_in
from rpbi.config.pybullet_models import (
    ChangeDynamics,
    CreateCollisionShape,
    CreateVisualShape,
    LoadURDF,
    ObjectTf,
    PybulletModel,
    ResetBaseVelocity,
    SetJointMotorControlArray,
)
from rpbi.config.pybullet_world_models import (
    ConfigureDebugVisualizer,
    Connect,
    ResetDebugVisualizerCamera,
    ResetSimulation,
    SetGravity,
    SetPhysicsEngineParameter,
)
from rpbi.engine.client import Client

SAMPLES: dict[type[PybulletModel], dict[str, Any]] = {
    LoadURDF: {"fileName": "plane.urdf", "flags": "URDF_USE_SELF_COLLISION"},
    CreateVisualShape: {
        "shapeType": "GEOM_MESH",
        "fileName": "cube.obj",
        "flags": "VISUAL_SHAPE_DOUBLE_SIDED",
        "vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0]],
        "indices": [0, 1, 2],
        "normals": [[0, 0, 1]] * 3,
        "uvs": [[0, 0], [1, 0], [0, 1]],
    },
    CreateCollisionShape: {
        "shapeType": "GEOM_MESH",
        "fileName": "cube.obj",
        "flags": "GEOM_FORCE_CONCAVE_TRIMESH",
        "vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0]],
        "indices": [0, 1, 2],
        "heightfieldData": [0.0, 0.1, 0.2, 0.3],
        "numHeightfieldRows": 2,
        "numHeightfieldColumns": 2,
    },
    ChangeDynamics: {
        "activationState": "ACTIVATION_STATE_DISABLE_SLEEPING",
        "contactStiffness": 100.0,
        "contactDamping": 1.0,
    },
    ResetBaseVelocity: {},
    SetJointMotorControlArray: {
        "controlMode": "POSITION_CONTROL",
        "positionGains": [0.1],
        "velocityGains": [1.0],
    },
    ResetSimulation: {"flags": "RESET_USE_DISCRETE_DYNAMICS_WORLD|RESET_USE_SIMPLE_BROADPHASE"},
    SetGravity: {},
    SetPhysicsEngineParameter: {
        "jointFeedbackMode": "JOINT_FEEDBACK_IN_JOINT_FRAME",
        "constraintSolverType": "CONSTRAINT_SOLVER_LCP_SI",
    },
    ConfigureDebugVisualizer: {"flag": "COV_ENABLE_SHADOWS"},
    ResetDebugVisualizerCamera: {},
}
"""Values for keys that cannot be guessed from the schema."""
NEEDED_TOO = {
    CreateVisualShape: {"fileName"},
    CreateCollisionShape: {"fileName"},
    ChangeDynamics: {"contactStiffness", "contactDamping"},
}
"""Keys that others depend on."""
BODY: dict[type[PybulletModel], dict[str, Any]] = {
    ChangeDynamics: {"bodyUniqueId": 0, "linkIndex": -1},
    ResetBaseVelocity: {"objectUniqueId": 0},
    SetJointMotorControlArray: {"bodyUniqueId": 0, "jointIndices": [0]},
}
"""What names the body in a call."""


@pytest.fixture
def pb() -> Iterator[Client]:
    """A client with one robot of one joint in it."""
    client = Client(pybullet.DIRECT)
    client.loadURDF(f"{pybullet_data.getDataPath()}/cartpole.urdf")
    yield client
    client.setPhysicsEngineParameter(contactBreakingThreshold=0.02)  # PyBullet keeps it for the whole process
    client.disconnect()


def sample(schema: Schema) -> Any:
    """Returns some value that fits the JSON Schema of a key."""
    kind = types_in(schema)[0]
    if kind == "array":
        return [sample(schema["items"])] * schema["minItems"]
    return {"number": 0.5, "integer": 1, "boolean": True, "string": "x"}[kind]


def cases() -> Iterator[Any]:
    """Yields every key of every model, with a value."""
    for model, samples in SAMPLES.items():
        for key, schema in json_schema(model, model.__name__)["properties"].items():
            value = samples[key] if key in samples else sample(schema)
            yield pytest.param(model, key, value, id=f"{model.__name__}.{key}")


@pytest.mark.parametrize(("model", "key", "value"), list(cases()))
def test_pybullet_takes_every_key_with_a_value_of_its_type(
    pb: Client, model: type[PybulletModel], key: str, value: Any
) -> None:
    samples = SAMPLES[model]
    needed = {name for name, field in model.model_fields.items() if field.is_required()}
    needed |= NEEDED_TOO.get(model, set())
    config = model.parse({**{name: samples[name] for name in needed}, key: value}, "f")
    function: Callable[..., Any] = getattr(pb, model.__name__[0].lower() + model.__name__[1:])
    calls = config.calls() if isinstance(config, ConfigureDebugVisualizer) else [config.kwargs()]
    for arguments in calls:
        assert key in arguments
        function(**BODY.get(model, {}), **arguments)


@pytest.mark.parametrize("key", ["lateralFrction", "bodyUniqueId", "linkIndex", "physicsClientId"])
def test_keys_unknown_to_pybullet_or_naming_the_body_are_refused(key: str) -> None:
    with pytest.raises(ConfigError, match=f"^f: {key}: unknown key '{key}'"):
        ChangeDynamics.parse({key: 1}, "f")


@pytest.mark.parametrize(
    "connect",
    [
        {"connection_mode": "DIRECT", "options": "--width=10"},
        {"connection_mode": "DIRECT", "key": 1234},
        {"connection_mode": 2, "hostName": "localhost", "port": 1234},
    ],
)
def test_pybullet_connects_with_the_configured_arguments(connect: dict[str, Any]) -> None:
    arguments = Connect.parse(connect, "f").kwargs()
    Client(arguments.pop("connection_mode"), **arguments).disconnect()


def test_connect_is_by_memory_or_by_network() -> None:
    with pytest.raises(ConfigError, match="^f: key: is for shared memory"):
        Connect.parse({"key": 1, "port": 1}, "f")


def test_connection_mode_has_a_default() -> None:
    assert Connect().kwargs() == {"connection_mode": pybullet.GUI}


def test_arguments_are_as_written_also_after_pickling() -> None:
    written = {"shapeType": "GEOM_BOX", "halfExtents": [1, 2, 3], "rgbaColor": None}
    shape = pickle.loads(pickle.dumps(CreateVisualShape.parse(written, "f")))
    assert shape.kwargs() == {"shapeType": pybullet.GEOM_BOX, "halfExtents": (1.0, 2.0, 3.0)}


def test_gravity_and_camera_are_complete_though_partly_written() -> None:
    assert SetGravity.parse({"gravZ": -9.81}, "f").kwargs() == {"gravX": 0.0, "gravY": 0.0, "gravZ": -9.81}
    assert ResetDebugVisualizerCamera().kwargs() == {
        "cameraDistance": 1.0,
        "cameraYaw": 0.0,
        "cameraPitch": 1.0,
        "cameraTargetPosition": (0.0, 0.0, 0.0),
    }


def test_visualizer_flags_become_one_call_each() -> None:
    written = {"flag": "COV_ENABLE_GUI|COV_ENABLE_SHADOWS", "enable": 1}
    assert ConfigureDebugVisualizer.parse(written, "f").calls() == [
        {"flag": pybullet.COV_ENABLE_GUI, "enable": True},
        {"flag": pybullet.COV_ENABLE_SHADOWS, "enable": True},
    ]
    assert ConfigureDebugVisualizer().calls() == [{"flag": pybullet.COV_ENABLE_GUI, "enable": False}]


@pytest.mark.parametrize(
    ("model", "written", "told"),
    [
        (
            CreateVisualShape,
            {"shapeType": "GEOM_MESH"},
            "fileName: missing, GEOM_MESH needs fileName or vertices",
        ),
        (
            CreateCollisionShape,
            {"shapeType": "GEOM_HEIGHTFIELD"},
            "fileName: missing, GEOM_HEIGHTFIELD needs fileName or heightfieldData",
        ),
        (
            CreateVisualShape,
            {"shapeType": "GEOM_BOX", "halfExtents": [1, 0, 1]},
            "halfExtents[1]: must be > 0 [m], got 0",
        ),
        (
            CreateCollisionShape,
            {"shapeType": "GEOM_PLANE", "planeNormal": [0, 0, 0]},
            "planeNormal: a direction cannot be all zeros",
        ),
        (
            CreateVisualShape,
            {"shapeType": 2, "rgbaColor": [1, 0, 0]},
            "rgbaColor: expected a list of 4 numbers, got 3",
        ),
        (
            CreateVisualShape,
            {"shapeType": 2, "height": 1},
            "height: unknown key 'height'; known are fileName, flags, halfExtents, indices, length, "
            "meshScale, normals, planeNormal, radius, rgbaColor, shapeType, specularColor, uvs, vertices, "
            "visualFrameOrientation, visualFramePosition",
        ),
        (ChangeDynamics, {"restitution": float("inf")}, "restitution: must be a finite number, got .inf"),
        (
            ChangeDynamics,
            {"mass": "1e3"},
            "mass: expected a number [kg], got text '1e3': YAML reads 1e3 as text: write 1.0e+3",
        ),
        (
            ChangeDynamics,
            {"contactStiffness": 1},
            "contactDamping: missing, PyBullet wants contactStiffness and contactDamping together",
        ),
        (LoadURDF, {}, "fileName: missing, expected a file name"),
        (
            LoadURDF,
            {"fileName": "plane.urdf", "useFixedBase": "yes"},
            "useFixedBase: expected true or false, got text 'yes'",
        ),
        (
            LoadURDF,
            {"fileName": "plane.urdf", "flags": "URDF_USE_SELF_COLISION"},
            "flags: unknown URDF flag 'URDF_USE_SELF_COLISION'; did you mean 'URDF_USE_SELF_COLLISION'?",
        ),
        (SetGravity, {"gravz": -9.81}, "gravz: unknown key 'gravz'; did you mean 'gravZ'?"),
        (SetPhysicsEngineParameter, {"numSolverIterations": 0}, "numSolverIterations: must be >= 1, got 0"),
        (
            Connect,
            {"connection_mode": "GIU"},
            "connection_mode: unknown connection mode 'GIU'; did you mean 'GUI'?",
        ),
        (ObjectTf, {"tf_id": "a", "hz": 0}, "hz: must be > 0 [Hz], got 0"),
        (
            SetJointMotorControlArray,
            {},
            "controlMode: missing, expected a control mode "
            "(POSITION_CONTROL, VELOCITY_CONTROL, TORQUE_CONTROL, IMPEDANCE_CONTROL)",
        ),
    ],
)
def test_wrong_value_is_found_before_pybullet_is_called(
    model: type[PybulletModel], written: dict[str, Any], told: str
) -> None:
    with pytest.raises(ConfigError) as caught:
        model.parse(written, "f")
    assert str(caught.value) == f"f: {told}"


def test_every_key_has_a_description() -> None:
    for model in (*SAMPLES, Connect, ObjectTf):
        for key, schema in json_schema(model, model.__name__)["properties"].items():
            assert schema.get("description", "").endswith("."), f"{model.__name__}.{key}"


def test_missing_file_is_reported_with_the_searched_folders(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=rf"f.yaml: fileName: no such file: robot.urdf \(looked in {tmp_path}, "):
        LoadURDF.parse({"fileName": "robot.urdf"}, str(tmp_path / "f.yaml"))
