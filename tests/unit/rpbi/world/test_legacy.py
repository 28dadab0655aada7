"""Worlds written for the authors' release still load, with a warning for each key that changed."""

from __future__ import annotations

from typing import Any

import pytest

from custom_ros_tools.errors import ConfigError
from custom_ros_tools.schema import ConfigModel
from rpbi.bodies import BODY_TYPES
from rpbi.world.legacy import LEGACY_KEYS
from rpbi.world.loading import load_object, load_world_dict

ROBOT: dict[str, Any] = {
    "name": "iiwa",
    "loadURDF": {"fileName": "kuka_iiwa/model.urdf"},
    "setJointMotorControlArray": {"controlMode": "POSITION_CONTROL"},
}


def robot(**more: Any) -> ConfigModel:
    """Loads a robot with these further keys."""
    return load_object("robot", {**ROBOT, **more}, "iiwa.yaml")


@pytest.mark.parametrize(
    ("old", "new", "value", "expected"),
    [
        ("publish_joint_state_frequency", "joint_state_publisher_hz", 100, 100.0),
        ("broadcast_link_states_frequency", "broadcast_link_states_hz", 30, 30.0),
        ("brodcast_link_states_frequency", "broadcast_link_states_hz", 30, 30.0),
        (
            "initial_joint_positions",
            "initial_joint_position",
            {"joint_1": 10},
            {"joint_1": 10.0},
        ),
    ],
)
def test_old_spelling_works_and_the_warning_names_the_new_one(
    caplog: pytest.LogCaptureFixture, old: str, new: str, value: Any, expected: Any
) -> None:
    assert getattr(robot(**{old: value}), new) == expected
    assert caplog.messages == [f"iiwa.yaml: {old}: is an old spelling: write {new}"]


def test_the_oldest_name_of_the_motors_works_too(caplog: pytest.LogCaptureFixture) -> None:
    motors = ROBOT["setJointMotorControlArray"]
    data = {"name": "iiwa", "loadURDF": ROBOT["loadURDF"], "setJointMotorControlArrayParameters": motors}
    assert load_object("robot", data, "iiwa.yaml") == robot()
    [message] = caplog.messages
    assert message.endswith("setJointMotorControlArrayParameters: is an old spelling: write setJointMotorControlArray")


def test_every_old_spelling_means_a_key_that_exists() -> None:
    for section, table in LEGACY_KEYS.items():
        (model,) = {body.Config for body in BODY_TYPES.values() if body.section == section}
        assert set(table.values()) <= set(model.model_fields)


def test_old_and_new_spelling_together_are_refused() -> None:
    with pytest.raises(ConfigError) as caught:
        robot(publish_joint_state_frequency=100, joint_state_publisher_hz=50)
    assert str(caught.value) == (
        "iiwa.yaml: publish_joint_state_frequency: means joint_state_publisher_hz, which is given too: remove one"
    )


def test_two_old_spellings_of_one_key_are_refused() -> None:
    with pytest.raises(ConfigError, match="means broadcast_link_states_frequency, which is given too"):
        robot(broadcast_link_states_frequency=30, brodcast_link_states_frequency=30)


def test_fault_in_an_old_spelling_is_reported_as_written() -> None:
    with pytest.raises(ConfigError) as caught:
        robot(publish_joint_state_frequency=-1)
    assert str(caught.value) == "iiwa.yaml: publish_joint_state_frequency: must be >= 0 [Hz], got -1"


@pytest.mark.parametrize(
    ("main", "told"),
    [
        ({"gravity": -9.81}, "~config: gravity: has no effect: write setGravity"),
        ({"visual_object": ["a.yaml"]}, "~config: visual_object: has no effect: write visual_objects"),
        (
            {"setPhysicsEngineParameter": {"fixedTimeStep": 0.01}},
            "~config: setPhysicsEngineParameter.fixedTimeStep: has no effect: write timeStep",
        ),
    ],
)
def test_key_without_effect_is_warned_of(caplog: pytest.LogCaptureFixture, main: dict[str, Any], told: str) -> None:
    load_world_dict(main, "~config")
    (message,) = caplog.messages
    assert message.startswith(told)


@pytest.mark.parametrize(
    ("object_tf", "told"),
    [
        ({"offset": [0.5, 0.0, 0.0]}, ["object_tf.offset", "object_tf"]),
        (
            {"offset": [0.5, 0.0, 0.0], "broadcast_tf": True},
            ["object_tf.offset", "object_tf.broadcast_tf", "object_tf"],
        ),
        (
            {"base_tf_id": "box", "is_static": True, "listener_frequency": 50, "timeout": 5.0, "tf_frame_id": "b"},
            [f"object_tf.{key}" for key in ("base_tf_id", "is_static", "listener_frequency", "timeout", "tf_frame_id")]
            + ["object_tf"],
        ),
        (
            {"pose_reset_hz": 100, "offset": {"transform": [0, 0.1, 0]}, "base": {"tf_id": "box", "is_static": True}},
            ["object_tf.pose_reset_hz", "object_tf.offset", "object_tf.base", "object_tf"],
        ),
        ({"hz": 10}, ["object_tf"]),
        ({}, ["object_tf"]),
    ],
)
def test_object_without_frame_stays_and_warns_of_each_key(
    caplog: pytest.LogCaptureFixture, object_tf: dict[str, Any], told: list[str]
) -> None:
    shape = {"shapeType": "GEOM_SPHERE", "radius": 0.1}
    ball = {"name": "ball", "createVisualShape": shape, "createCollisionShape": shape}
    thing = {"name": "thing", "loadURDF": ROBOT["loadURDF"]}
    for kind, data in (("robot", ROBOT), ("visual", ball), ("collision", ball), ("urdf", thing)):
        caplog.clear()
        loaded = load_object(kind, {**data, "object_tf": object_tf}, "a.yaml")
        assert loaded.object_tf is None  # type: ignore[attr-defined]
        assert {message.split(": ")[1] for message in caplog.messages} == set(told)
        assert all("has no effect" in message for message in caplog.messages)


def test_unused_keys_of_object_tf_warn_and_its_frame_works(caplog: pytest.LogCaptureFixture) -> None:
    loaded = robot(object_tf={"tf_id": "base", "hz": 10, "offset": [1.0, 0.0, 0.0]})
    assert loaded.object_tf.tf_id == "base" and loaded.object_tf.hz == 10.0  # type: ignore[attr-defined]
    (message,) = caplog.messages
    assert message == "iiwa.yaml: object_tf.offset: has no effect: publish a TF frame with the offset in it"


@pytest.mark.parametrize("object_tf", [{"tfid": "base"}, {"hz": 10, "max_speed": 1.0}, {"offset": [1.0], "hzz": 2}])
def test_misspelt_frame_is_an_error_nevertheless(object_tf: dict[str, Any]) -> None:
    with pytest.raises(ConfigError, match="object_tf"):
        robot(object_tf=object_tf)


def test_dynamic_object_follows_nothing(caplog: pytest.LogCaptureFixture) -> None:
    shape = {"shapeType": "GEOM_SPHERE", "radius": 0.1}
    ball = {"name": "ball", "createVisualShape": shape, "createCollisionShape": shape, "changeDynamics": {}}
    load_object("dynamic", {**ball, "baseMass": 1.0, "object_tf": {"tf_id": "base"}}, "ball.yaml")
    assert caplog.messages == [
        "ball.yaml: object_tf: has no effect: physics moves it; write basePosition and baseOrientation"
    ]


def test_ignored_motor_arguments_are_warned_of(caplog: pytest.LogCaptureFixture) -> None:
    robot(setJointMotorControlArray={"controlMode": "POSITION_CONTROL", "forces": [1.0]})
    assert caplog.messages == [
        "iiwa.yaml: setJointMotorControlArray.forces: has no effect: efforts are limited by the URDF"
    ]
