"""Episodes exported as data sets: their content, bad episodes, a full disk, and formats of a user's own."""

from __future__ import annotations

import errno
import json
import resource
import shutil
from pathlib import Path

import genpy
import h5py
import numpy as np
import pytest
import rosbag
from pyarrow import parquet
from rosbags.highlevel import AnyReader
from scipy.spatial.transform import Rotation
from std_msgs.msg import Float64
from written_episodes import CAMERA, JOINTS, STATES, TARGETS, WRENCH, write_episode

from rpbi_data import EpisodeFolder, bag_to_dataframes, bag_to_images, episodes_to_dataframes
from rpbi_data.datasets import export as export_steps
from rpbi_data.datasets.formats import lerobot
from rpbi_data.datasets.video import read_video

VIDEO = "videos/observation.images.camera_colour/chunk-000/file-{:03d}.mp4"
START_S = 1.002
"""Time of the first joint states and images."""


@pytest.fixture(scope="module")
def rows(exported):
    """The rows of the LeRobot data set as columns, and its description."""
    folder = exported("lerobot")
    table = parquet.read_table(folder / "data/chunk-000/file-000.parquet")
    columns = {key: np.array(table.column(key).to_pylist()) for key in table.column_names}
    return columns, json.loads((folder / "meta/info.json").read_text())


def first_of(columns, episode):
    return columns["episode_index"] == episode


def test_features_are_derived_from_the_topics(rows):
    _, info = rows
    features = {key: each["names"] for key, each in info["features"].items() if each["dtype"] != "video"}
    joints = list(JOINTS)
    assert features["observation.state"] == features["observation.velocity"] == joints
    assert features["observation.effort"] == features["action"] == joints
    forces = [f"force.{axis}" for axis in "xyz"]
    assert features["observation.wrench.arm_wrist_ft_sensor"] == forces + [f"torque.{axis}" for axis in "xyz"]
    assert features["observation.contact_force.box"] == forces
    assert features["observation.pose.box"] == ["x", "y", "z", "qx", "qy", "qz", "qw"]
    assert {key for key, each in info["features"].items() if each["dtype"] == "video"} == {
        "observation.images.camera_colour",
        "observation.images.side_colour",
    }
    assert (info["fps"], info["total_episodes"], info["total_frames"]) == (30, 3, 126)


def test_rows_are_resampled_and_have_true_stamps_and_errors(rows, demos):
    columns, info = rows
    own = first_of(columns, 1)
    times = columns["source.stamp"][own] @ np.array([1.0, 1e-9])
    assert times == pytest.approx(START_S + np.arange(own.sum()) / 30, abs=1e-9)
    assert columns["timestamp"][own] == pytest.approx(np.arange(own.sum()) / 30, abs=1e-6)
    states = bag_to_dataframes(demos.folder_of(1) / "episode.bag", "/rpbi/arm/joint_states")["/rpbi/arm/joint_states"]
    for number, joint in enumerate(JOINTS):
        expected = np.interp(times, states.index, states[f"position/{joint}"])
        assert columns["observation.state"][own][:, number] == pytest.approx(expected, abs=1e-6)
    errors = columns["source.time_error"][own]
    names = info["features"]["source.time_error"]["names"]
    assert errors[:, names.index("observation.state")].max() <= 0.005 + 1e-6
    nearest = np.abs(states.index.to_numpy()[:, None] - times).min(axis=0)
    assert errors[:, names.index("observation.state")] == pytest.approx(nearest, abs=1e-6)
    assert 0.01 < errors[:, names.index("observation.images.camera_colour")].max() < 0.04


@pytest.mark.parametrize("timing", ["next", "previous"])
def test_actions_are_the_newest_targets_after_initial_measured_positions(timing, rows, demos, tmp_path, run):
    """The default, next, has the target that was in force at the end of the row, which LeRobot records."""
    columns, _ = rows
    if timing == "previous":
        assert run("export", demos.path, "--out", tmp_path / "out", "--images", "--action", timing)[0] == 0
        table = parquet.read_table(tmp_path / "out/data/chunk-000/file-000.parquet")
        columns = {key: np.array(table.column(key).to_pylist()) for key in table.column_names}
    own = first_of(columns, 0)
    rows_ns = columns["source.stamp"][own] @ np.array([10**9, 1])
    times = rows_ns + round(1e9 / 30) - 1 if timing == "next" else rows_ns
    targets = bag_to_dataframes(demos.folder_of(0) / "episode.bag", TARGETS, nanoseconds=True)[TARGETS]
    actions, states = columns["action"][own], columns["observation.state"][own]
    before = times < targets.index[0]
    assert before.any() and not before.all()
    assert np.array_equal(actions[before], states[before])
    newest = np.searchsorted(targets.index, times[~before], side="right") - 1
    for number, joint in enumerate(JOINTS[:2]):
        assert actions[~before][:, number] == pytest.approx(targets[f"position/{joint}"].to_numpy()[newest], abs=1e-6)
    assert np.array_equal(actions[:, 2], states[:, 2])  # which never gets a target


def test_quaternions_do_not_jump(rows):
    columns, _ = rows
    for episode in range(3):
        quats = columns["observation.pose.box"][first_of(columns, episode)][:, 3:]
        assert (np.einsum("ij,ij->i", quats[1:], quats[:-1]) > 0.9).all()
        assert np.linalg.norm(quats, axis=1) == pytest.approx(1.0, abs=1e-6)
    times = columns["source.stamp"] @ np.array([1.0, 1e-9]) - 1.0
    phase = 0.4 * columns["episode_index"]
    found = Rotation.from_quat(columns["observation.pose.box"][:, 3:])
    difference = found * Rotation.from_euler("z", 4.0 * times + phase).inv()
    assert difference.magnitude().max() < 1e-3


def test_videos_show_the_newest_images(rows, exported, demos):
    columns, _ = rows
    times = columns["source.stamp"][first_of(columns, 2)] @ np.array([1.0, 1e-9])
    images = list(bag_to_images(demos.folder_of(2) / "episode.bag", CAMERA))
    stamps = np.array([stamp for stamp, _ in images])
    film = list(read_video(exported("lerobot") / VIDEO.format(2)))
    assert [time_s for time_s, _ in film] == pytest.approx(np.arange(len(times)) / 30, abs=1e-6)
    for time_s, (_, pixels) in zip(times, film, strict=True):
        wanted = images[np.searchsorted(stamps, time_s, side="right") - 1][1]
        assert np.abs(pixels.astype(int) - wanted)[..., 1].mean() < 4.0


def test_each_episode_has_its_hash_chain_and_its_source(exported, demos):
    for name in ("lerobot", "robomimic", "mcap"):
        facts = json.loads((exported(name) / "rpbi/episode_000001.json").read_text())
        assert (facts["source"]["episode"], facts["source"]["label"], facts["source"]["seeds"]) == (1, "failure", "7")
        states = bag_to_dataframes(demos.folder_of(1) / "episode.bag", "/rpbi/state")["/rpbi/state"]
        chain = facts["state_hashes"]["chain"]
        assert [(each["tick"], each["hash"]) for each in chain] == list(zip(states["tick"], states["state_hash"]))


def test_robomimic_has_scaled_actions_rewards_and_a_mask(rows, exported):
    columns, _ = rows
    with h5py.File(exported("robomimic") / "dataset.hdf5") as file:
        low, high = file["action_scaling/low"][:], file["action_scaling/high"][:]
        for index in range(3):
            demo = file[f"data/demo_{index}"]
            actions = demo["actions"][:]
            assert np.abs(actions).max() <= 1.0
            wanted = columns["action"][first_of(columns, index)]
            assert low + (actions + 1) / 2 * (high - low) == pytest.approx(wanted, abs=1e-6)
            assert np.array_equal(demo["obs/state"][:], columns["observation.state"][first_of(columns, index)])
            assert demo["rewards"][-1] == (index != 1) and demo["dones"][-1] == 1
            assert demo["obs/images_camera_colour"].shape == (len(actions), 84, 84, 3)
        assert [each.decode() for each in file["mask/success"]] == ["demo_0", "demo_2"]
        train, valid = ({each.decode() for each in file[f"mask/{name}"]} for name in ("train", "valid"))
        assert len(valid) == 1 and train | valid == {"demo_0", "demo_1", "demo_2"} and not train & valid
        assert json.loads(file["data"].attrs["env_args"])["env_name"] == "ros_pybullet_interface"


def test_mcap_has_all_messages(exported, demos):
    with AnyReader([exported("mcap") / "episode_000000"]) as reader:
        counts = {each.topic: each.msgcount for each in reader.connections}
        (states,) = [each for each in reader.connections if each.topic == "/rpbi/arm/joint_states"]
        assert states.msgtype == "sensor_msgs/msg/JointState"
        _, stamp_ns, raw = next(reader.messages([states]))
        message = reader.deserialize(raw, states.msgtype)
    assert counts == {topic: each["messages"] for topic, each in demos.read(0).topics.items()}
    assert list(message.name) == list(JOINTS) and stamp_ns == 1_002_000_000


def test_bad_episodes_are_named_and_the_others_exported(tmp_path, run, caplog):
    folder = EpisodeFolder(tmp_path / "demos")
    for index in range(5):
        write_episode(folder, "good" if index else "bad", seconds=0.5, cameras=(), has_targets=index != 2)
    for of_record in (True, False):
        write_episode(folder, "good", seconds=0.5, cameras=(), set_back_s=5.0, of_record=of_record)
    write_episode(folder, "good", seconds=0.5, cameras=())
    with rosbag.Bag(str(folder.folder_of(7) / "episode.bag"), "a") as opened:
        opened._topic_connections.pop(WRENCH, None)
        opened.write(WRENCH, Float64(), genpy.Time(2))
    bag = folder.folder_of(0) / "episode.bag"
    bag.write_bytes(bag.read_bytes()[:9000])
    (folder.folder_of(3) / "episode.yaml").write_text("[")
    folder.part_of(8).mkdir()  # of a recorder that was killed at once
    folder.part_of(9).mkdir()
    (folder.part_of(9) / "episode.yaml").write_text("number: 9\ntopics: {/a: {messages: 1}}")
    code, text = run("episodes", folder.path, "--repair")
    assert code == 0 and text.count(": incomplete: the recorder was killed, no message recovered: ") == 2
    assert "episode 9: " in text and "topics./a.type: missing" in text
    code, text = run("episodes", folder.path)
    assert code == 0 and len(text.splitlines()) == 11 and "  cannot be read: line 1, column 2" in text
    assert text.count("complete, a clock was set back by 4.99 s") == 2
    states = episodes_to_dataframes(folder.path, STATES)[STATES]
    assert set(states.index.get_level_values("episode")) == {1, 2, 4, 5, 6, 7}
    assert f"left out: {bag}: has no index" in caplog.text
    assert f"left out: {folder.folder_of(3)}/episode.yaml: cannot be read" in caplog.text
    code, text = run("export", folder.path, "--to", "robomimic", "--out", tmp_path / "out")
    assert code == 1
    assert f"episode 0: {bag}: has no index" in text
    assert "episode 2: " in text and "no messages for 'action', which other episodes have" in text
    assert f"episode 3: {folder.folder_of(3) / 'episode.yaml'}: cannot be read" in text
    clocks = [f"episode {each}: {folder.folder_of(each)}/episode.bag: " for each in (5, 6)]
    for each in clocks:
        assert f"{each}/rpbi/arm/joint_states: its clock was set back by 4.99 s at 6.242 s" in text
    assert f"{WRENCH}: expected messages of one type, got geometry_msgs/WrenchStamped and std_msgs/Float64" in text
    assert "out has 2 episodes" in text
    with h5py.File(tmp_path / "out/dataset.hdf5") as file:
        assert list(file["data"]) == ["demo_0", "demo_1"]
    assert run("check_dataset", tmp_path / "out")[0] == 0
    code, text = run("export", folder.path, "--to", "mcap", "--out", tmp_path / "mcap")
    assert code == 1 and all(each in text for each in clocks) and "mcap has 3 episodes" in text
    code, text = run("export", folder.path, "--to", "robomimic", "--out", tmp_path / "out")
    assert code == 1 and "exists already" in text
    code, text = run("export", folder.path, "--to", "robomimic", "--out", tmp_path / "none", "--label", "perfect")
    assert code == 1 and "no episode with the label perfect can be exported" in text
    code, text = run("export", folder.path, "--to", "robomimic", "--out", tmp_path / "none", "--state", "/wrong")
    assert code == 1 and "unknown topic '/wrong'" in text
    assert sorted(each.name for each in tmp_path.iterdir()) == ["demos", "mcap", "out"]


def test_full_disk_is_named_and_complete_episodes_are_kept(demos, tmp_path, run, file_limit):
    code, text = run("export", demos.path, "--out", tmp_path / "none", "--disk-reserve-mb", "1e9")
    assert code == 1 and "MB free on the disk, less than the reserve" in text
    folder = EpisodeFolder(tmp_path / "demos")
    for seconds in (0.6, 20.0, 0.6):
        write_episode(folder, seconds=seconds)
    file_limit(350_000)
    code, text = run("export", folder.path, "--out", tmp_path / "out", "--option", "preset=ultrafast", "crf=0")
    assert code == 1
    assert "episode 1: " in text and "File too large" in text and "episodes 2 are not exported" in text
    assert " has 1 episode\n" in text
    file_limit(1_000_000)
    code, text = run("export", folder.path, "--to", "robomimic", "--out", tmp_path / "small")
    assert code == 1 and "episode 1: [Errno 27] File too large" in text and " has 1 episode\n" in text
    shutil.rmtree(tmp_path / "small")
    file_limit(1_000)
    code, text = run("export", folder.path, "--to", "mcap", "--out", tmp_path / "none")
    assert code == 1 and "File too large" in text
    file_limit(resource.RLIM_INFINITY)
    assert run("check_dataset", tmp_path / "out")[0] == 0
    assert sorted(each.name for each in tmp_path.iterdir()) == ["demos", "out"]


@pytest.mark.parametrize(
    ("name", "owner", "step", "nth", "left_out"),
    [
        ("lerobot", export_steps, "write_episode", 2, "1"),
        ("lerobot", lerobot, "_json", 1, "2"),
        ("robomimic", export_steps, "write_episode", 2, "1"),
        ("robomimic", export_steps, "write_export", 1, "2"),
        ("mcap", export_steps, "write_episode", 2, "1"),
    ],
)
def test_episode_without_space_for_its_facts_is_removed(
    demos, tmp_path, run, monkeypatch, name, owner, step, nth, left_out
):
    calls, write = [], getattr(owner, step)

    def write_until_full(*arguments):
        calls.append(step)
        write(*arguments)
        if len(calls) == nth:
            raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(owner, step, write_until_full)
    code, text = run("export", demos.path, "--to", name, "--images", "--out", tmp_path / "out")
    assert code == 1 and f"episode {left_out}: [Errno 28] No space left on device" in text
    assert f"out has {left_out} episode" in text and ("episodes 2 are not exported" in text) == (left_out == "1")
    code, text = run("check_dataset", tmp_path / "out")
    assert code == 0, text


def test_options_and_topics_can_be_chosen(demos, tmp_path, run):
    words = ("--fps", "10", "--label", "failure", "--images", "--action", "/rpbi/arm/wrist/ft_sensor")
    code, text = run("export", demos.path, "--out", tmp_path / "out", *words, "--option", "robot_type=arm")
    assert code == 0, text
    info = json.loads((tmp_path / "out/meta/info.json").read_text())
    assert (info["fps"], info["robot_type"], info["total_episodes"], info["total_frames"]) == (10, "arm", 1, 14)
    assert info["features"]["action"]["names"][0] == "wrench.force.x" and not (tmp_path / "out/videos").exists()
    assert parquet.read_table(tmp_path / "out/meta/tasks.parquet").to_pandas().index.tolist() == ["demos"]
    assert run("check_dataset", tmp_path / "out")[0] == 0
    code, text = run("export", demos.path, "--out", tmp_path / "none", "--option", "preset=fastest")
    assert code == 1 and "--option: preset: " in text and not (tmp_path / "none").exists()
    code, text = run("export", demos.path, "--to", "lerobo", "--out", tmp_path / "none")
    assert code == 1 and "unknown data set format 'lerobo'" in text


def test_a_format_of_a_users_own(demos, tmp_path, run):
    words = ("--images", "--option", "digits=3")
    code, text = run("export", demos.path, "--to", "table_format:TableFormat", "--out", tmp_path / "out", *words)
    assert code == 0, text
    assert (tmp_path / "out/1.csv").read_text().count("\n") == 42
    code, text = run("check_dataset", tmp_path / "out", "--formats", "table_format:TableFormat")
    assert (code, text) == (0, "3 tables: no fault\n")
    (tmp_path / "out/1.csv").write_text("")
    assert run("check_dataset", tmp_path / "out", "--formats", "table_format:TableFormat")[0] == 1


def test_a_killed_export_leaves_nothing_under_the_name(demos, tmp_path, run):
    part = tmp_path / ".out.part"
    part.mkdir()
    (part / "half").write_text("")
    assert run("export", demos.path, "--to", "robomimic", "--out", tmp_path / "out", "--images")[0] == 0
    assert [each.name for each in tmp_path.iterdir()] == ["out"]
    shutil.rmtree(tmp_path / "out")
    assert not Path(part).exists()
