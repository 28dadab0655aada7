"""Faults that are planted in a LeRobot data set, each of which is named."""

from __future__ import annotations

import json
import os
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

from rpbi_data.datasets.video import VideoWriter, read_video

DATA, TASKS, EPISODES = (
    "data/chunk-000/file-000.parquet",
    "meta/tasks.parquet",
    "meta/episodes/chunk-000/file-000.parquet",
)
CAMERA, SIDE = "observation.images.camera_colour", "observation.images.side_colour"
VIDEO, SIDE_VIDEO = f"videos/{CAMERA}/chunk-000/file-001.mp4", f"videos/{SIDE}/chunk-000/file-001.mp4"
POSE, WRENCH = "observation.pose.box", "observation.wrench.arm_wrist_ft_sensor"
ROWS = slice(36, 78)
"""Rows of episode 1."""


def edit_json(name: str, change: Callable[[Any], object]) -> Callable[[Path], None]:
    def plant(folder: Path) -> None:
        data = json.loads((folder / name).read_text())
        change(data)
        (folder / name).write_text(json.dumps(data))

    return plant


def edit_table(name: str, change: Callable[[dict[str, Any]], object]) -> Callable[[Path], None]:
    """Changes the columns of a Parquet file, as lists; types stay."""

    def plant(folder: Path) -> None:
        table = parquet.read_table(folder / name)
        columns = table.to_pydict()
        change(columns)
        fields = {field.name: field.type for field in table.schema}
        arrays = {key: pa.array(values, fields.get(key)) for key, values in columns.items()}
        parquet.write_table(pa.table(arrays).replace_schema_metadata(table.schema.metadata), folder / name)

    return plant


def edit_column(key: str, change: Callable[[np.ndarray], object]) -> Callable[[Path], None]:
    """Changes the values of a feature in episode 1, shape (n, columns)."""

    def edit(columns: dict[str, Any]) -> None:
        values = np.array(columns[key])
        change(values[ROWS])
        columns[key] = values.tolist()

    return edit_table(DATA, edit)


def late(values: np.ndarray) -> None:
    values[1:] = values[:-1].copy()


def swap(values: np.ndarray) -> None:
    values[:, [0, 1]] = values[:, [1, 0]]


def truncate(name: str) -> Callable[[Path], None]:
    def plant(folder: Path) -> None:
        data = (folder / name).read_bytes()
        (folder / name).write_bytes(data[: len(data) * 2 // 3])

    return plant


def refilm(change: Callable[[list[np.ndarray]], list[np.ndarray]], fps: int = 30) -> Callable[[Path], None]:
    """Encodes a video again with other frames, or at another rate."""

    def plant(folder: Path) -> None:
        images = change([pixels for _, pixels in read_video(folder / VIDEO)])
        (folder / VIDEO).unlink()
        height, width, _ = images[0].shape
        with VideoWriter(folder / VIDEO, fps, height, width, "veryfast", 20) as video:
            for pixels in images:
                video.add(pixels)

    return plant


def swap_videos(folder: Path) -> None:
    first, second = (folder / name for name in (VIDEO, SIDE_VIDEO))
    shutil.move(first, folder / "other")
    shutil.move(second, first)
    shutil.move(folder / "other", second)


def put(place: Any, *path: Any) -> None:
    """Sets a value in nested mappings and lists; the last word is the value."""
    *way, last, value = path
    for each in way:
        place = place[each]
    place[last] = value


PLANTED: dict[str, tuple[Callable[[Path], object], str]] = {
    "data file truncated": (truncate(DATA), rf"{DATA}: cannot be read"),
    "data file missing": (lambda folder: (folder / DATA).unlink(), rf"{DATA}: is missing"),
    "description truncated": (truncate("meta/info.json"), r"meta/info.json: cannot be read"),
    "old version": (
        edit_json("meta/info.json", lambda info: put(info, "codebase_version", "v2.1")),
        r"meta/info.json: expected codebase_version v3.0, found v2.1",
    ),
    "video missing": (lambda folder: (folder / VIDEO).unlink(), rf"{VIDEO}: is missing, with the images of episodes 1"),
    "video truncated": (truncate(VIDEO), rf"{VIDEO}: cannot be (read|decoded)"),
    "colours swapped": (
        refilm(lambda images: [each[..., ::-1].copy() for each in images]),
        r"episode 1: its red, green and blue are the blue, green, red of the images",
    ),
    "frames frozen": (
        refilm(lambda images: [*images[:10], *[images[10]] * 20, *images[30:]]),
        r"episode 1: \d+ frames are frozen while the images that were exported move, first frame (9|10|11)",
    ),
    "image missing": (refilm(lambda images: images[:-1]), rf"{VIDEO}: 41 frames, but its episodes have 42 rows"),
    "image black": (
        refilm(lambda images: [*images[:20], np.zeros_like(images[20]), *images[21:]]),
        rf"{VIDEO}: episode 1: 1 frames show another image than was exported, first frame 20",
    ),
    "images late": (
        refilm(lambda images: [images[0], *images[:-1]]),
        rf"{VIDEO}: episode 1: its frames are late by one frame",
    ),
    "images of the other camera": (swap_videos, rf"{VIDEO}: episode 1: its frames are the images of '{SIDE}'"),
    "images of another size": (
        refilm(lambda images: [pixels[:-8] for pixels in images]),
        rf"{VIDEO}: 64 x 40 pixels, but meta/info.json has the shape \[48, 64, 3\]",
    ),
    "video of another rate": (refilm(list, fps=25), rf"{VIDEO}: 25 frames a second, but meta/info.json has 30"),
    "unknown path": (
        edit_json("meta/info.json", lambda info: put(info, "data_path", "data/{number}.parquet")),
        r"meta/info.json: data_path: expected the placeholders chunk_index, file_index, found 'number'",
    ),
    "wrong fps": (
        edit_json("meta/info.json", lambda info: put(info, "fps", 25)),
        r"meta/info.json: fps: 30 rows a second were exported, found 25",
    ),
    "stamps late": (
        edit_column("timestamp", lambda values: np.add(values, 1 / 30, out=values)),
        rf"{DATA}: episode 1: timestamp: is late by one frame",
    ),
    "true stamps late": (
        edit_column("source.stamp", late), rf"{DATA}: episode 1: 'source.stamp': 'nsec' is late by one frame"
    ),
    "actions late": (edit_column("action", late), rf"{DATA}: episode 1: 'action': 'elbow' is late by one frame"),
    "joints swapped": (
        edit_column("observation.state", swap),
        rf"{DATA}: episode 1: 'observation.state': 'shoulder' has the values that were exported as 'elbow'",
    ),
    "names swapped": (
        edit_json("meta/info.json", lambda info: info["features"]["action"]["names"].reverse()),
        r"meta/info.json: features: 'action' is of \['wrist', 'elbow', 'shoulder'\], was exported as \['shoulder', ",
    ),
    "not a number": (
        edit_column(WRENCH, lambda values: put(values, (7, 2), np.nan)),
        rf"{DATA}: episode 1: '{WRENCH}': 'force.z' is not finite in 1 frames, first in frame 7",
    ),
    "sign of quaternion": (
        edit_column(POSE, lambda values: np.negative(values[10:, 3:], out=values[10:, 3:])),
        rf"{DATA}: episode 1: '{POSE}': the quaternion changes its sign 1 times, first from frame 9 to 10",
    ),
    "no unit quaternion": (
        edit_column(POSE, lambda values: put(values, (5, 6), 2.0)), rf"'{POSE}': the quaternion of frame 5 is no unit"
    ),
    "action out of range": (
        edit_column("action", lambda values: put(values, (3, 1), 40.0)), r"meta/stats.json: 'action': max: .* is 40$"
    ),
    "one value changed": (
        edit_column("observation.velocity", lambda values: np.add(values, 1e-6, out=values)),
        rf"{DATA}: episode 1: 'observation.velocity': 'wrist' was changed after the export",
    ),
    "gap in frame_index": (
        edit_column("frame_index", lambda values: np.add(values[9:], 1, out=values[9:])),
        rf"{DATA}: episode 1: frame_index: expected 9 in frame 9, found 10",
    ),
    "gap in index": (
        edit_column("index", lambda values: put(values, 4, 0)),
        rf"{DATA}: episode 1: index: expected 40 in frame 4, found 0",
    ),
    "row of another episode": (
        edit_column("episode_index", lambda values: put(values, 0, 0)),
        rf"{DATA}: episode 1: episode_index: expected 1 in frame 0, found 0",
    ),
    "row lost": (
        edit_table(DATA, lambda columns: [values.pop(50) for values in columns.values()]),
        rf"{DATA}: 125 rows, but meta/episodes has 126",
    ),
    "feature lost": (
        edit_table(DATA, lambda columns: columns.pop(WRENCH)), rf"{DATA}: '{WRENCH}' of meta/info.json is missing"
    ),
    "wrong task": (
        edit_column("task_index", lambda values: values.fill(3)),
        rf"{DATA}: episode 1: task_index: 3 is not in meta/tasks.parquet",
    ),
    "wrong total": (
        edit_json("meta/info.json", lambda info: put(info, "total_frames", 127)),
        r"meta/info.json: total_frames: 127, but the lengths in meta/episodes sum up to 126",
    ),
    "wrong number of episodes": (
        edit_json("meta/info.json", lambda info: put(info, "total_episodes", 4)),
        r"meta/info.json: total_episodes: 4, but meta/episodes has 3",
    ),
    "wrong length": (
        edit_table(EPISODES, lambda columns: put(columns, "length", 1, 40)),
        r"meta/episodes: episode 1: 42 frames were exported, found length 40",
    ),
    "wrong place of rows": (
        edit_table(EPISODES, lambda columns: put(columns, "dataset_from_index", 1, 35)),
        r"meta/episodes: episode 1: expected its rows at 36 to 78, found 35 to 78",
    ),
    "wrong time in the video": (
        edit_table(EPISODES, lambda columns: put(columns, f"videos/{CAMERA}/from_timestamp", 1, 1 / 60)),
        rf"{VIDEO}: episode 1: no frame at each of its times",
    ),
    "wrong shape": (
        edit_json("meta/info.json", lambda info: put(info, "features", "action", "shape", [4])),
        rf"{DATA}: 'action' has 3 numbers a row, but meta/info.json has the shape \[4\]",
    ),
    "wrong type": (
        edit_json("meta/info.json", lambda info: put(info, "features", "action", "dtype", "float64")),
        rf"{DATA}: 'action' is of type float32, but meta/info.json has float64",
    ),
    "wrong split": (
        edit_json("meta/info.json", lambda info: put(info, "splits", "train", "0:9")),
        r"meta/info.json: splits: 'train' is 0:9, there are 3 episodes",
    ),
    "wrong statistic": (
        edit_json("meta/stats.json", lambda stats: put(stats, "action", "mean", 2, 9.0)),
        r"meta/stats.json: 'action': mean: 9 in column 2, but that of the values is",
    ),
    "statistic missing": (
        edit_json("meta/stats.json", lambda stats: stats.pop("action")), r"meta/stats.json: nothing for 'action'"
    ),
    "hash changed": (
        edit_json("rpbi/episode_000001.json", lambda facts: put(facts, "state_hashes", "chain", 4, "hash", "0")),
        r"rpbi/episode_000001.json: the chain of state hashes is broken at tick 201",
    ),
    "hash lost": (
        edit_json("rpbi/episode_000001.json", lambda facts: facts["state_hashes"]["chain"].pop()),
        r"rpbi/episode_000001.json: the chain of state hashes is incomplete: it ends with 13 states",
    ),
    "facts lost": (
        lambda folder: (folder / "rpbi/episode_000001.json").unlink(),
        r"rpbi/episode_000001.json cannot be read: no such file",
    ),
}  # fmt: skip


def test_a_clean_data_set_has_no_fault(exported, demos, run):
    folder = exported("lerobot")
    code, text = run("check_dataset", folder, "--source", demos.path)
    assert (code, text) == (0, "LeRobot v3.0: 3 episodes, 126 frames: no fault\n")


@pytest.mark.parametrize("name", PLANTED)
def test_a_planted_fault_is_named(name, exported, tmp_path, run):
    plant, expected = PLANTED[name]
    folder = tmp_path / "planted"
    shutil.copytree(exported("lerobot"), folder)
    plant(folder)
    code, text = run("check_dataset", folder)
    assert code == 1
    assert [line for line in text.splitlines() if re.search(expected, line)], text


def test_a_data_set_without_facts_is_checked_for_the_rest(exported, tmp_path, run):
    folder = tmp_path / "foreign"
    shutil.copytree(exported("lerobot"), folder)
    shutil.rmtree(folder / "rpbi")
    code, text = run("check_dataset", folder)
    assert code == 0 and "without rpbi/, values were not compared" in text
    edit_column("action", lambda values: put(values, (3, 1), 40.0))(folder)
    assert run("check_dataset", folder)[0] == 1


def test_another_recording_than_that_of_the_export_is_named(exported, demos, tmp_path, run):
    shutil.copytree(demos.path, tmp_path / "demos")
    bag = tmp_path / "demos/episode_000001/episode.bag"
    bag.write_bytes(bag.read_bytes() + b"0")
    shutil.rmtree(tmp_path / "demos/episode_000002")
    pipe = tmp_path / "demos/episode_000000/episode.bag"
    pipe.unlink()
    os.mkfifo(pipe)
    code, text = run("check_dataset", exported("lerobot"), "--source", tmp_path / "demos")
    assert code == 1
    assert f"{bag}: is not the recording that episode 1 was exported from" in text
    assert "episode 2: its recording cannot be read: " in text
    assert f"episode 0: its recording cannot be read: {pipe}: expected an ordinary file" in text
