"""Files with measured tosses and pushes: what is read, and which errors name file and array."""

from __future__ import annotations

import numpy as np
import pytest
from real_contacts import push_arrays, toss_arrays, write

from custom_ros_tools.errors import ConfigError
from rpbi_reality.pushes.push_data import errors_against, mean_poses, read_runs, spread
from rpbi_reality.tosses.toss_data import TossData


def test_tosses_are_read(tmp_path):
    data = TossData.read(write(tmp_path / "cube_tosses.npz", toss_arrays()))
    assert [toss.name for toss in data.tosses] == ["7", "8"]
    assert len(data.tosses[1].position) == 30 and data.frame_rate == 148.0
    assert data.tosses[0].start.linear_velocity.tolist() == [0.5, 0.0, 0.0]


def _without(key):
    return lambda arrays: arrays.pop(key)


@pytest.mark.parametrize(
    ("spoil", "key", "message"),
    [
        (_without("start_quaternion"), "start_quaternion", "missing"),
        (lambda a: a.update(position=a["position"][:, :2]), "position", "expected shape any x 3"),
        (lambda a: a.update(position=a["position"] * 1000.0), "position", "are lengths in millimetres?"),
        (lambda a: a.update(side=np.array(104.8)), "side", "are lengths in millimetres?"),
        (lambda a: a.update(offset=a["offset"][::-1].copy()), "offset", "expected increasing rows"),
        (lambda a: a["position"].__setitem__((3, 1), np.nan), "position", "not finite"),
        (lambda a: a.update(quaternion=a["quaternion"] * 2.0), "quaternion", "norm 1"),
        (lambda a: a.update(start_position=a["start_position"][:1]), "start_position", "one row for each of 2 tosses"),
    ],
)
def test_faulty_tosses_are_refused_with_file_and_array(tmp_path, spoil, key, message):
    arrays = toss_arrays()
    spoil(arrays)
    with pytest.raises(ConfigError) as refused:
        TossData.read(write(tmp_path / "cube_tosses.npz", arrays))
    assert "cube_tosses.npz" in str(refused.value) and key in str(refused.value) and message in str(refused.value)


def test_python_objects_are_refused(tmp_path):
    arrays = {**toss_arrays(), "toss": np.array([print, print], object)}
    with pytest.raises(ConfigError, match="without Python objects"):
        TossData.read(write(tmp_path / "cube_tosses.npz", arrays))
    (tmp_path / "text.npz").write_text("no archive")
    with pytest.raises(ConfigError, match="expected an NPZ file"):
        TossData.read(tmp_path / "text.npz")


def test_spread_is_the_distance_from_the_mean_of_the_others(tmp_path):
    runs = [run.poses for run in read_runs(write(tmp_path / "arm_pushes.npz", push_arrays()))]
    assert spread(runs).hand_mm == pytest.approx([1.5, 0.0, 1.5], abs=1e-6)
    assert errors_against(mean_poses(runs), runs).hand_mm == pytest.approx([1.0, 0.0, 1.0], abs=1e-6)
    assert spread(runs).cube_final_mm == pytest.approx([0.0] * 3)


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda a: a.update(experiment=a["experiment"] + 6), "expected 1, 2 or 3, got 7"),
        (lambda a: a.update(time=a["time"] * 0.1), "covers 0.0 to 0.6 s"),
        (lambda a: a["time"].__setitem__(5, 0.0), "expected increasing times in run 1"),
        (lambda a: a.update(hand_position=a["hand_position"] * 1000.0), "millimetres"),
        (_without("cube_quaternion"), "cube_quaternion: missing"),
    ],
)
def test_faulty_pushes_are_refused(tmp_path, spoil, message):
    arrays = push_arrays()
    spoil(arrays)
    with pytest.raises(ConfigError, match=message):
        read_runs(write(tmp_path / "arm_pushes.npz", arrays))
