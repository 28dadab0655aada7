"""TF frames whose poses the main file says, and keys that replace those of the main file."""

from __future__ import annotations

import math

import pytest
from worlds import ball, write_world

from custom_ros_tools.errors import ConfigError
from rpbi.config.world import WorldConfig
from rpbi.world.loading import load_world

HALF = math.sqrt(0.5)


def poses(*entries, **more):
    return WorldConfig.parse({"poses": list(entries), **more}, "world.yaml")


def test_roll_pitch_and_yaw_say_the_same_as_a_quaternion():
    by_rpy = poses({"tf_id": "a", "rpy": [math.pi / 2, 0.0, math.pi / 2]}).pose_of("a")
    by_quat = poses({"tf_id": "a", "orientation": [0.5, 0.5, 0.5, 0.5]}).pose_of("a")
    assert by_rpy.quat_xyzw == pytest.approx(by_quat.quat_xyzw)
    assert poses({"tf_id": "a"}).pose_of("a") == ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))


def test_poses_include_those_of_parents_and_prefixes_are_optional():
    config = poses(
        {"tf_id": "tip", "parent": "table", "position": [0.0, 1.0, 0.0]},
        {"tf_id": "table", "position": [2.0, 0.0, 0.0], "orientation": [0.0, 0.0, HALF, HALF]},
        {"tf_id": "eye", "parent": "rpbi/arm/hand"},
        tf_prefix="left",
    )
    assert config.pose_of("tip").position == pytest.approx((1.0, 0.0, 0.0))
    assert config.pose_of("left/tip") == config.pose_of("tip")
    assert config.pose_of("eye") is None and config.pose_of("unknown") is None


@pytest.mark.parametrize(
    ("entries", "expected"),
    [
        ([{"tf_id": "a", "rpy": [0, 0, 0], "orientation": [0, 0, 0, 1]}], "poses[0].rpy: says the same as orientation"),
        ([{"tf_id": "a"}, {"tf_id": "a"}], "poses[1].tf_id: 'a' has a pose already"),
        ([{"tf_id": "rpbi/world"}], "poses[0].tf_id: expected another frame"),
        ([{"tf_id": "a", "parent": "a"}], "poses[0].tf_id: expected another frame"),
        ([{"tf_id": "a", "parent": "b"}, {"tf_id": "b", "parent": "a"}], "poses[1].parent: 'a' hangs on 'b' itself"),
        ([{"tf_id": "a b"}], "poses[0].tf_id: a TF frame has no spaces"),
        ([{"position": [0, 0, 0]}], "poses[0].tf_id: missing"),
    ],
)
def test_invalid_poses_are_refused(entries, expected):
    with pytest.raises(ConfigError) as error:
        poses(*entries)
    assert f"world.yaml: {expected}" in str(error.value)


def test_keys_can_replace_those_of_the_main_file(tmp_path):
    path = write_world(tmp_path, dynamic=(ball(),), real_time_factor=2.0, connect={"connection_mode": "GUI"})
    as_written = load_world(path).config
    changed = load_world(path, overrides={"real_time_factor": 0.5, "connect": {"connection_mode": "DIRECT"}}).config
    assert (as_written.real_time_factor, changed.real_time_factor) == (2.0, 0.5)
    assert (as_written.connect.connection_mode, changed.connect.connection_mode) == (1, 2)
    assert changed.timeStep == as_written.timeStep
    with pytest.raises(ConfigError, match=r"world.yaml: real_time_facto: unknown key"):
        load_world(path, overrides={"real_time_facto": 1.0})
