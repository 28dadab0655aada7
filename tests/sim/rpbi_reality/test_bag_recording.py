"""Bags as measured motion of an identification."""

from __future__ import annotations

from pathlib import Path

import genpy
import numpy as np
import pytest
import rosbag
from geometry_msgs.msg import PoseStamped, TransformStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState

from custom_ros_tools.errors import ConfigError, InterfaceError
from rpbi_reality.identification.bag_recording import read_bag, signal_of
from rpbi_reality.identification.fit_config import FitConfig
from rpbi_reality.identification.recording_files import read_recordings

START_S = 1.7e9
"""Stamps are wall time."""


def _fit(*signals: str) -> FitConfig:
    return FitConfig.parse(
        {
            "measured": {signal: {"object": "box"} for signal in signals},
            "parameters": {"mass": {"set": "box.baseMass", "bounds": [0.1, 2.0]}},
        },
        "fit.yaml",
    )


def _stamped(kind, time_s, **fields):
    message = kind(**fields)
    message.header.stamp = genpy.Time.from_sec(START_S + time_s)
    return message


def _joints(time_s: float, **positions: float) -> JointState:
    return _stamped(JointState, time_s, name=list(positions), position=list(positions.values()))


def _odometry(time_s: float) -> Odometry:
    message = _stamped(Odometry, time_s)
    message.pose.pose.position.x, message.pose.pose.orientation.w = 0.1 * time_s, 1.0
    return message


def _write(path: Path, messages: list[tuple[str, object]]) -> Path:
    with rosbag.Bag(str(path), "w") as bag:
        for topic, message in messages:
            bag.write(topic, message, message.header.stamp + genpy.Duration(0, 3_000_000))
    return path


@pytest.fixture
def bag(tmp_path) -> Path:
    """Joint states from 0 s on, a box from 0.2 s on, and targets at -0.5, -0.1 and 1.0 s."""
    states = [("/rpbi/arm/joint_states", _joints(t, a=t, b=-t)) for t in np.arange(0.0, 2.0, 0.01).tolist()]
    box = [("/rpbi/box/base_state", _odometry(t)) for t in np.arange(0.2, 2.0, 0.02).tolist()]
    targets = [("/rpbi/arm/joint_states/target", _joints(t, a=t)) for t in (-0.5, -0.1, 1.0)]
    return _write(tmp_path / "run.bag", states + box + targets)


def test_the_run_starts_when_all_signals_have_started(bag):
    run = read_bag(bag, _fit("arm", "box"))
    assert run.name == "run" and set(run.poses) == {"box"} and set(run.joints) == {"arm"}
    assert run.joints["arm"].names == ("a", "b")
    assert run.joints["arm"].time[[0, 1]] == pytest.approx([0.0, 0.01], abs=1e-6)
    assert run.joints["arm"].position[0] == pytest.approx([0.2, -0.2])
    assert run.poses["box"].time == pytest.approx(np.arange(90) * 0.02, abs=1e-6)
    assert run.poses["box"].position[-1] == pytest.approx([0.198, 0.0, 0.0])
    assert run.end_s == pytest.approx(1.79, abs=1e-6)


def test_the_newest_target_before_the_start_applies_from_the_start(bag):
    targets = read_bag(bag, _fit("arm", "box")).inputs["arm/target"]
    assert targets.names == ("a",)
    assert targets.time == pytest.approx([0.0, 0.8], abs=1e-6)
    assert targets.position[:, 0].tolist() == [-0.1, 1.0]


def test_poses_of_trackers_are_read_and_other_topics_ignored(tmp_path):
    messages: list[tuple[str, object]] = []
    for t in (0.0, 0.1, 0.2):
        transform, pose = _stamped(TransformStamped, t), _stamped(PoseStamped, t)
        transform.transform.translation.y = t
        transform.transform.rotation.z = 2.0  # is scaled to norm 1
        pose.pose.position.z, pose.pose.orientation.w = t, 1.0
        messages += [("/vicon/box/box", transform), ("/camera/pose", pose), ("/other/joint_states", _joints(t, c=t))]
    run = read_bag(_write(tmp_path / "trackers.bag", messages), _fit("vicon/box/box", "camera/pose"))
    assert run.poses["vicon/box/box"].position[:, 1] == pytest.approx([0.0, 0.1, 0.2])
    assert run.poses["vicon/box/box"].quaternion[0].tolist() == [0.0, 0.0, 1.0, 0.0]
    assert run.poses["camera/pose"].position[:, 2] == pytest.approx([0.0, 0.1, 0.2])
    assert not run.joints and not run.inputs


@pytest.mark.parametrize(
    ("topic", "signal"),
    [
        ("/rpbi/arm/joint_states", "arm"),
        ("/stand_in/rpbi/panda/joint_states/target", "panda/target"),
        ("/rpbi/box/base_state", "box"),
        ("/joint_states", "joint_states"),
        ("/vicon/box/box", "vicon/box/box"),
    ],
)
def test_signals_are_named_after_objects(topic, signal):
    assert signal_of(topic) == signal


def test_a_signal_that_the_bag_lacks_is_named(bag):
    with pytest.raises(
        ConfigError, match="expected a topic of this signal; the bag has arm, arm/target, box"
    ) as refused:
        read_recordings(bag, _fit("bax"))
    assert "run.bag" in str(refused.value) and "bax" in str(refused.value)


def test_joint_states_of_several_publishers_are_refused(tmp_path):
    messages = [("/joint_states", _joints(t, a=t) if i % 2 else _joints(t, b=t)) for i, t in enumerate((0.0, 0.1, 0.2))]
    path = _write(tmp_path / "mixed.bag", messages)
    with pytest.raises(ConfigError, match="joint_states.*not finite"):
        read_recordings(path, _fit("joint_states"))


def test_stamps_that_jump_are_refused(tmp_path):
    times = [0.01 * i + (3600.0 if i > 50 else 0.0) for i in range(100)]
    path = _write(tmp_path / "jump.bag", [("/rpbi/box/base_state", _odometry(t)) for t in times])
    with pytest.raises(ConfigError, match="steady stamps, but they jump by"):
        read_recordings(path, _fit("box"))


def test_a_broken_bag_is_refused(tmp_path):
    (tmp_path / "broken.bag").write_bytes(b"#ROSBAG V2.0\n" + bytes(100))
    with pytest.raises(InterfaceError, match=r"broken\.bag"):
        read_recordings(tmp_path / "broken.bag", _fit("box"))
