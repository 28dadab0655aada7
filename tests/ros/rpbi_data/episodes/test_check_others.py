"""Faults that are planted in data sets of robomimic and rosbag2, and folders that are none."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from rosbags.rosbag2 import Reader, StoragePlugin, Writer

FILE = "dataset.hdf5"


def edit(change: Callable[[h5py.File], object]) -> Callable[[Path], None]:
    def plant(folder: Path) -> None:
        with h5py.File(folder / FILE, "r+") as file:
            change(file)

    return plant


def put(name: str, place: object, value: object) -> Callable[[Path], None]:
    """Sets numbers of a data set of episode 1."""

    def change(file: h5py.File) -> None:
        values = file[f"data/demo_1/{name}"]
        values[place] = value

    return edit(change)


def late(name: str) -> Callable[[Path], None]:
    def change(file: h5py.File) -> None:
        values = file[f"data/demo_1/{name}"]
        values[1:] = values[:-1]

    return edit(change)


def swap_joints(file: h5py.File) -> None:
    state = file["data/demo_1/obs/state"]
    state[...] = state[:][:, [1, 0, 2]]


def flip(file: h5py.File) -> None:
    poses = file["data/demo_1/obs/pose_box"]
    poses[10:, 3:] = -poses[10:, 3:]


def halve_actions(file: h5py.File) -> None:
    for demo in file["data"].values():
        demo["actions"][...] = demo["actions"][:] / 2


def truncate(folder: Path) -> None:
    data = (folder / FILE).read_bytes()
    (folder / FILE).write_bytes(data[: len(data) // 2])


ROBOMIMIC: dict[str, tuple[Callable[[Path], object], str]] = {
    "file truncated": (truncate, rf"{FILE}: cannot be read"),
    "action out of range": (put("actions", (5, 0), 1.5), r"actions: 1 frames are outside of \[-1, 1\], first frame 5"),
    "not a number": (put("obs/velocity", (3, 2), np.nan), r"demo_1: obs/velocity: 'wrist' is not finite in 1 frames"),
    "joints swapped": (edit(swap_joints), r"obs/state: 'shoulder' has the values that were exported as 'elbow'"),
    "state late": (late("obs/state"), r"demo_1: obs/state: 'wrist' is late by one frame"),
    "images late": (late("obs/images_camera_colour"), r"obs/images_camera_colour: its images are late by one frame"),
    "image black": (put("obs/images_camera_colour", 7, 0), r"the image of frame 7 is another than was exported"),
    "sign of quaternion": (edit(flip), r"obs/pose_box: the quaternion changes its sign 1 times"),
    "next_obs": (put("next_obs/effort", (2, 0), 3.0), r"next_obs/effort: is not obs/effort one frame later"),
    "wrong total": (edit(lambda file: file["data"].attrs.modify("total", 7)), r"total: 7, but num_samples .* 126"),
    "wrong num_samples": (
        edit(lambda file: file["data/demo_1"].attrs.modify("num_samples", 41)),
        r"demo_1: num_samples: 41 for 42 actions",
    ),
    "wrong dones": (put("dones", 4, 1), r"demo_1: dones: expected 1 in the last frame alone"),
    "observation lost": (
        edit(lambda file: file.pop("data/demo_1/obs/effort")),
        r"obs/effort: was exported and is missing",
    ),
    "actions lost": (edit(lambda file: file.pop("data/demo_1/actions")), r"demo_1: expected actions, found none"),
    "episode lost": (edit(lambda file: file.pop("data/demo_1")), r"demo_0 to demo_1, found demo_0, demo_2"),
    "mask of none": (edit(lambda file: file.move("data/demo_2", "data/demo_9")), r"mask/success: no episode demo_2"),
    "environment": (edit(lambda file: file["data"].attrs.modify("env_args", "{")), r"env_args: cannot be read"),
    "scaling": (edit(halve_actions), r"action_scaling: column 0 reaches 0.5, expected 1"),
}  # fmt: skip


@pytest.mark.parametrize("name", ROBOMIMIC)
def test_a_planted_fault_of_robomimic_is_named(name, exported, tmp_path, run):
    plant, expected = ROBOMIMIC[name]
    folder = tmp_path / "planted"
    shutil.copytree(exported("robomimic"), folder)
    plant(folder)
    code, text = run("check_dataset", folder)
    assert code == 1 and re.search(expected, text), text


@pytest.mark.parametrize("name", ["robomimic", "mcap"])
def test_a_clean_data_set_has_no_fault(name, exported, demos, run):
    code, text = run("check_dataset", exported(name), "--source", demos.path)
    assert code == 0 and text.endswith(": no fault\n"), text


def rewrite(change: Callable[[list], object]) -> Callable[[Path], None]:
    """Writes a recording anew with other messages."""

    def plant(folder: Path) -> None:
        place = folder / "episode_000001"
        with Reader(place) as reader:
            connections = list(reader.connections)
            messages = [[connection.id, stamp, data] for connection, stamp, data in reader.messages()]
        change(messages)
        shutil.rmtree(place)
        with Writer(place, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            known = {
                each.id: writer.add_connection(each.topic, each.msgtype, msgdef=each.msgdef.data, rihs01=each.digest)
                for each in connections
            }
            for number, stamp, data in messages:
                writer.write(known[number], stamp, data)

    return plant


def truncate_mcap(folder: Path) -> None:
    (path,) = folder.glob("episode_000001/*.mcap")
    path.write_bytes(path.read_bytes()[:2000])


MCAP: dict[str, tuple[Callable[[Path], object], str]] = {
    "file truncated": (truncate_mcap, r"episode_000001: (cannot be read|is damaged)"),
    "message lost": (rewrite(lambda messages: messages.pop(300)), r"messages were exported, found"),
    "stamp late": (rewrite(lambda messages: put_late(messages)), r"stamps or contents were changed after the export"),
    "episode lost": (lambda folder: shutil.rmtree(folder / "episode_000002"), r"3 episodes were exported, found 2"),
}  # fmt: skip


def put_late(messages: list) -> None:
    messages[300][1] += 1_000_000


@pytest.mark.parametrize("name", MCAP)
def test_a_planted_fault_of_mcap_is_named(name, exported, tmp_path, run):
    plant, expected = MCAP[name]
    folder = tmp_path / "planted"
    shutil.copytree(exported("mcap"), folder)
    plant(folder)
    code, text = run("check_dataset", folder)
    assert code == 1 and re.search(expected, text), text


def test_a_folder_of_another_tool_is_named(tmp_path, run):
    (tmp_path / "notes.txt").write_text("")
    code, text = run("check_dataset", tmp_path)
    assert code == 1 and "not a data set of a known format" in text and "found notes.txt" in text
    code, text = run("check_dataset", tmp_path / "missing")
    assert code == 1 and "expected a folder with a data set, there is none" in text
    (tmp_path / "meta").mkdir()
    (tmp_path / "meta/info.json").write_text(json.dumps({"name": "of another tool"}))
    code, text = run("check_dataset", tmp_path)
    assert code == 1 and "meta/info.json: expected codebase_version, fps, " in text
    with h5py.File(tmp_path / "other.hdf5", "w") as file:
        file["values"] = [1.0]
    shutil.rmtree(tmp_path / "meta")
    code, text = run("check_dataset", tmp_path)
    assert code == 1 and "other.hdf5: expected a group 'data', found none" in text
