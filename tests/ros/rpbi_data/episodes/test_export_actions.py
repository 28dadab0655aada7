"""Exported rows as the user chooses them: meaning of actions, gripper, observations, time errors, resets."""

from __future__ import annotations

import json

import h5py
import numpy as np
import pytest
from pyarrow import parquet
from scipy.spatial.transform import Rotation
from written_episodes import JOINTS, write_episode

from rpbi_data import EpisodeFolder

EVERY = np.array([1.0, 1e-9])


@pytest.fixture(scope="module")
def export(demos, run, tmp_path_factory):
    """Exports the episodes, and returns names and rows of features."""

    def export(*words):
        out = tmp_path_factory.mktemp("chosen") / "out"
        code, text = run("export", demos.path, "--out", out, "--images", *words)
        assert code == 0, text
        assert run("check_dataset", out)[0] == 0
        table = parquet.read_table(out / "data/chunk-000/file-000.parquet")
        features = json.loads((out / "meta/info.json").read_text())["features"]
        names = {key: each["names"] for key, each in features.items()}
        return names, {key: np.array(table.column(key).to_pylist(), float) for key in table.column_names}

    return export


@pytest.fixture(scope="module")
def plain(export):
    return export()[1]


def test_deltas_are_relative_to_measured_positions_except_for_the_gripper(export, plain):
    names, rows = export("--action", "deltas", "--gripper", "elbow")
    assert names["observation.state"] == ["shoulder", "wrist"] and names["observation.gripper"] == ["elbow"]
    assert names["action"] == ["shoulder", "wrist", "elbow"]
    assert rows["observation.gripper"] == pytest.approx(plain["observation.state"][:, 1])
    changes = plain["action"] - plain["observation.state"]
    assert rows["action"][:, :2] == pytest.approx(changes[:, [0, 2]], abs=1e-6)
    assert rows["action"][:, 2] == pytest.approx(plain["action"][:, 1]) and np.abs(changes[:, 0]).max() > 0.05


def test_end_effector_actions_are_poses_of_the_next_row(export):
    words = ("--end-effector", "box", "--gripper", "elbow", "--action", "pose")
    names, rows = export(*words)
    pose = ["x", "y", "z", "qx", "qy", "qz", "qw"]
    assert names["observation.end_effector"] == pose and names["action"] == [*pose, "elbow"]
    seen, actions = rows["observation.end_effector"], rows["action"]
    same = rows["episode_index"][1:] == rows["episode_index"][:-1]
    assert actions[:-1, :3][same] == pytest.approx(seen[1:, :3][same], abs=1e-6)
    following = Rotation.from_quat(seen[1:, 3:][same])
    assert (Rotation.from_quat(actions[:-1, 3:7][same]) * following.inv()).magnitude().max() < 1e-5
    names, deltas = export(*words, "deltas")
    assert names["action"] == ["x", "y", "z", "rx", "ry", "rz", "elbow"]
    assert deltas["action"][:-1, :3][same] == pytest.approx((seen[1:] - seen[:-1])[same][:, :3], abs=1e-6)
    assert deltas["action"][:-1, 3:6][same] == pytest.approx(np.tile([0.0, 0.0, 4.0 / 30], (same.sum(), 1)), abs=1e-4)
    assert deltas["action"][:, 6] == pytest.approx(actions[:, 7])


def test_observations_can_be_selected(export):
    names, _ = export("--features", "velocity", "pose.*")
    observed = {key for key in names if key.startswith("observation.")}
    assert observed == {"observation.state", "observation.velocity", "observation.pose.box"}
    names, _ = export("--features", "--end-effector", "rpbi/box")
    observed = {key for key in names if key.startswith("observation.")}
    assert observed == {"observation.state", "observation.end_effector"}


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--features", "pose.bx"), "unknown feature 'pose.bx': known are state, velocity, effort, "),
        (("--end-effector", "boxx"), "unknown frame on TF 'boxx': known are box; did you mean 'box'?"),
        (("--gripper", "finger"), f"unknown joint of the gripper 'finger': known are {', '.join(JOINTS)}"),
        (("--action", "deltas", "/rpbi/arm/wrist/ft_sensor"), "expected targets of joint positions, got 'wrench/"),
        (("--max-time-error", "0.01"), "'observation.images.camera_colour': the nearest message is 0.0"),
    ],
)
def test_impossible_exports_are_named(demos, run, tmp_path, words, message):
    code, text = run("export", demos.path, "--to", "robomimic", "--out", tmp_path / "out", *words)
    assert code == 1 and message in text, text
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("pose", "--action pose: expected --end-effector ROBOT/LINK, too"),
        ("next previous", "--action: expected next or previous, and pose only with next, got next previous"),
        ("pose previous", "--action: expected next or previous, and pose only with next, got pose previous"),
    ],
)
def test_words_of_actions_that_exclude_each_other_are_named(demos, run, words, message):
    with pytest.raises(SystemExit) as caught:
        run("export", demos.path, "--action", *words.split())
    assert str(caught.value.__context__) == message


def test_rows_begin_after_the_last_reset_of_an_episode(run, tmp_path):
    folder = EpisodeFolder(tmp_path / "demos")
    for reset_s in (0.75, np.inf):
        write_episode(folder, seconds=1.5, cameras=(), reset_s=reset_s)
    code, text = run("export", folder.path, "--out", tmp_path / "out")
    assert code == 0 and "episode 0: 21 frames, as 0 (from its last reset on, at 1.802 s)\n" in text, text
    rows = parquet.read_table(tmp_path / "out/data/chunk-000/file-000.parquet").to_pandas()
    starts = [np.array(list(rows[rows["episode_index"] == each]["source.stamp"])) @ EVERY for each in (0, 1)]
    assert [each[0] for each in starts] == pytest.approx([1.802, 1.002], abs=1e-9)
    facts = [json.loads((tmp_path / f"out/rpbi/episode_00000{each}.json").read_text()) for each in (0, 1)]
    assert facts[0]["cut"] == {"resets": 1, "stamp_ns": 1_802_000_000} and "cut" not in facts[1]


def test_the_share_of_episodes_for_validation_can_be_chosen(demos, run, tmp_path):
    for share, count in (("0", 0), ("0.7", 2)):
        words = ("--images", "--option", f"valid={share}")
        assert run("export", demos.path, "--to", "robomimic", "--out", tmp_path / share, *words)[0] == 0
        with h5py.File(tmp_path / share / "dataset.hdf5") as file:
            assert [len(file["mask"].get(name, ())) for name in ("train", "valid")] == [3 - count, count]
