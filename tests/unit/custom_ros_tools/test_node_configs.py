"""What the nodes may be told: the documented keys and defaults, and clear words about anything else."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from custom_ros_tools.errors import ConfigError
from custom_ros_tools.node_configs import FloatArrayConfig, MarkerConfig, RateParameters, RemapConfig, StartParameters
from custom_ros_tools.schema import ConfigModel

MARKER = {"node": {"topic_name": "marker"}, "type": "cube", "scale": [1, 2, 3]}


def marker(**changes: Any) -> MarkerConfig:
    """Returns the configuration of a marker."""
    return MarkerConfig.parse({**MARKER, **changes}, "~config")


def test_marker_has_the_documented_defaults() -> None:
    config = marker()
    assert (config.node.hz, config.node.broadcast_offset) == (50.0, False)
    assert (config.frame_id, config.action, config.position) == ("map", "ADD", (0.0, 0.0, 0.0))
    assert (config.rgba, config.mesh_uri) == ((0.0, 0.0, 1.0, 0.9), "")
    assert config.quat_xyzw == [0, 0, 0, 1]


def test_each_side_of_a_marker_has_its_own_length() -> None:
    """Defect 48: the release took the length along y for z as well."""
    assert marker().scale == (1.0, 2.0, 3.0)


@pytest.mark.parametrize("written", ["Sphere", "SPHERE", "sphere"])
def test_marker_type_may_be_written_in_any_case(written: str) -> None:
    assert marker(type=written).type == "SPHERE"


@pytest.mark.parametrize(
    ("orientation", "in_deg"),
    [([0, 0, math.pi / 2], False), ([0, 0, 90], True), ([0, 0, 1, 1], False), ([0, 0, 1, 1], True)],
)
def test_marker_orientation_may_be_angles_or_a_quaternion(orientation: list[float], in_deg: bool) -> None:
    config = marker(orientation=orientation, ori_in_deg=in_deg)
    np.testing.assert_allclose(config.quat_xyzw, [0, 0, math.sqrt(0.5), math.sqrt(0.5)], atol=1e-12)


@pytest.mark.parametrize(
    ("written", "uri"),
    [
        ("package://my_robot/a.stl", "package://my_robot/a.stl"),
        ("{my_robot}/meshes/a.stl", "package://my_robot/meshes/a.stl"),
        ("/data/a.stl", "file:///data/a.stl"),
    ],
)
def test_mesh_is_named_as_rviz_finds_it(written: str, uri: str) -> None:
    assert marker(type="mesh_resource", mesh_resource=written).mesh_uri == uri


def test_joint_state_numbers_are_positions_in_message_order_by_default() -> None:
    assert FloatArrayConfig() == FloatArrayConfig(joint_names=None, field="position")


@pytest.mark.parametrize(
    ("model", "data", "told"),
    [
        (MarkerConfig, {}, "~config: node: missing"),
        (MarkerConfig, {}, "~config: type: missing, expected the name of a marker type"),
        (MarkerConfig, {}, "~config: scale: missing, expected a list of 3 numbers"),
        (MarkerConfig, {**MARKER, "type": "cub"}, "type: unknown marker type 'cub'; did you mean 'CUBE'?"),
        (MarkerConfig, {**MARKER, "type": 1}, "type: expected text, got 1"),
        (MarkerConfig, {**MARKER, "action": "remove"}, "action: unknown marker action 'remove'"),
        (MarkerConfig, {**MARKER, "scale": [1, 2]}, "scale: expected a list of 3 numbers, got 2"),
        (MarkerConfig, {**MARKER, "scale": [1, 2, -1]}, "scale[2]: must be >= 0, got -1"),
        (MarkerConfig, {**MARKER, "orientation": [0, 0]}, "orientation: expected roll, pitch, yaw or a quaternion"),
        (MarkerConfig, {**MARKER, "orientation": [0, 0, 0, 0]}, "orientation: quaternion: must not be zero"),
        (MarkerConfig, {**MARKER, "orientation": [0, 0, math.nan]}, "orientation[2]: must be a finite number"),
        (MarkerConfig, {**MARKER, "rgba": [0, 0, 255, 1]}, "rgba[2]: must be <= 1, got 255"),
        (MarkerConfig, {**MARKER, "type": "mesh_resource"}, "mesh_resource: missing, expected a file"),
        (MarkerConfig, {**MARKER, "colour": [0, 0, 1, 1]}, "colour: unknown key 'colour'"),
        (MarkerConfig, {**MARKER, "node": {"topic_name": "a b"}}, "node.topic_name: expected the name of a topic"),
        (MarkerConfig, {**MARKER, "node": {"topic_name": "a", "hz": 0}}, "node.hz: must be > 0 [Hz], got 0"),
        (
            MarkerConfig,
            {**MARKER, "node": {"topic_name": "a", "broadcast_offset": True}},
            "node.child_frame_id: missing, expected a TF frame since broadcast_offset is true",
        ),
        (FloatArrayConfig, {"field": "torque"}, "field: must be 'position', 'velocity' or 'effort', got text 'torque'"),
        (FloatArrayConfig, {"joint_names": "a"}, "joint_names: expected a list"),
        (FloatArrayConfig, {"joint_name": ["a"]}, "joint_name: unknown key 'joint_name'; did you mean 'joint_names'?"),
        (RemapConfig, {"joints": [{"rename": "a"}]}, "joints[0].joint: missing"),
        (RemapConfig, {"joints": [{"joint": "a", "sign": 2}]}, "joints[0].sign: must be 1 or -1, got 2"),
        (
            RemapConfig,
            {"joints": [{"joint": "a", "unit": "turn"}]},
            "joints[0].unit: must be 'rad', 'deg', 'm' or 'mm'",
        ),
        (RemapConfig, {"joints": [{"joint": "a"}] * 2}, "joints[1].joint: 'a' is the name of another joint"),
        (
            RemapConfig,
            {"joints": [{"joint": "a", "rename": "b"}, {"joint": "b"}]},
            "joints[1].rename: 'b' is the name of another joint of this list",
        ),
        (StartParameters, {"start_on_init": "yes"}, "start_on_init: expected true or false, got text 'yes'"),
        (RateParameters, {"hz": -1.0}, "hz: must be > 0 [Hz], got -1"),
    ],
)
def test_faulty_configuration_is_reported(model: type[ConfigModel], data: dict[str, Any], told: str) -> None:
    with pytest.raises(ConfigError) as caught:
        model.parse(data, "~config")
    assert told in str(caught.value)
