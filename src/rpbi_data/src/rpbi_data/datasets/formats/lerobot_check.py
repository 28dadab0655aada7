"""Defines the file and column names of LeRobot data sets, version 3.0, and checks such data sets."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rpbi_data.datasets.checks import Facts, feature_faults, guarded
from rpbi_data.datasets.coarse_images import coarse, frozen_faults, image_faults
from rpbi_data.datasets.foreign_files import file_name, read_json, read_parquet
from rpbi_data.datasets.format import STATE, Array
from rpbi_data.datasets.provenance import read_images
from rpbi_data.datasets.statistics import statistics

if TYPE_CHECKING:
    import pyarrow as pa

VERSION = "v3.0"
CHUNK = 1000
"""Largest number of files in a folder."""
DATA_PATH = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
VIDEO_PATH = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
EPISODES_PATH = "meta/episodes/chunk-000/file-000.parquet"
ROW_COLUMNS = {
    "timestamp": "float32",
    "frame_index": "int64",
    "episode_index": "int64",
    "index": "int64",
    "task_index": "int64",
}
"""Types of the columns that every data set has, indexed by column."""
NO_NUMBERS = ("image", "string", "audio")
"""Types of columns whose values are not checked; they occur in data sets of other tools."""
MAX_TIME_ERROR_S = 1e-4
"""Largest deviation of a time stamp from `frame_index / fps`, as in LeRobot's own reader [s]."""
MAX_STATISTIC_ERROR = 1e-4
"""Largest deviation of a stored statistic, as a share of the column's largest absolute value."""
REQUIRED = (
    "codebase_version",
    "fps",
    "features",
    "total_episodes",
    "total_frames",
    "total_tasks",
    "data_path",
    "chunks_size",
)


def place(number: int) -> dict[str, int]:
    """Returns the folder index and the file index of the data or video file with the given number."""
    return {"chunk_index": number // CHUNK, "file_index": number % CHUNK}


def data_file(number: int) -> Path:
    """Returns the path of a data file, relative to the data set."""
    return Path(DATA_PATH.format(**place(number)))


def video_file(key: str, number: int) -> Path:
    """Returns the path of a video file, relative to the data set."""
    return Path(VIDEO_PATH.format(video_key=key, **place(number)))


def matrix(column: Any) -> Array:
    """Converts a column of a Parquet table to an array of the shape (rows, numbers per row).

    Raises:
        ValueError: If rows are empty, differ in length, or do not consist of numbers.
    """
    array = column.combine_chunks()
    if array.null_count:
        raise ValueError(f"{array.null_count} rows have no value")
    rows = len(array)
    while hasattr(array.type, "value_type"):
        array = array.flatten()
    flat = np.asarray(array)
    if rows and len(flat) % rows:
        raise ValueError("rows differ in length")
    flat = flat.reshape(rows, -1) if rows else flat.reshape(0, 1)
    if flat.dtype.kind not in "iufb":
        raise ValueError(f"expected numbers, got {array.type}")
    return flat


def lerobot_faults(folder: Path) -> Iterator[str]:
    """Yields a message for each fault of a LeRobot data set."""
    check = _Check(folder)
    yield from guarded("meta/info.json", check.info_faults())
    if not check.is_readable:
        return
    yield from guarded("meta/tasks.parquet", check.task_faults())
    yield from guarded("meta/episodes", check.episode_faults())
    yield from guarded("data", check.data_faults())
    yield from guarded("meta/stats.json", check.statistics_faults())
    yield from guarded("videos", check.video_faults())
    yield from guarded("rpbi/export.json", check.facts.total_faults(len(check.episodes)))
    yield from check.facts.faults


class _Check:
    """Checks a data set. Methods use results of previous methods, and must be called in the order of definition."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.facts = Facts(folder)
        self.is_readable = False
        self._info: dict[str, Any] = {}
        self._tasks: dict[int, str] = {}
        self.episodes: list[dict[str, Any]] = []
        self._values: dict[str, list[Array]] = {}
        self._stored: dict[int, dict[str, Any]] = {}

    # --- meta/info.json

    def info_faults(self) -> Iterator[str]:
        """Checks `meta/info.json`, which describes the data set."""
        path = "meta/info.json"
        try:
            info = read_json(self._folder, path)
        except ValueError as error:
            yield f"{path}: {_unreadable(error)}"
            return
        missing = [key for key in REQUIRED if key not in info] if isinstance(info, dict) else REQUIRED
        if missing:
            yield f"{path}: expected {', '.join(missing)}, found none"
            return
        self._info = info
        version = info["codebase_version"]
        if version != VERSION:
            yield f"{path}: expected codebase_version {VERSION}, found {version}"
            return
        if not isinstance(info["features"], dict) or not all(map(_is_feature, info["features"].values())):
            yield f"{path}: expected features with 'dtype' and 'shape'"
            return
        if not isinstance(info["fps"], (int, float)) or info["fps"] <= 0:
            yield f"{path}: fps: expected a positive number, found {info['fps']}"
            return
        self.is_readable = True
        yield from self._feature_faults(path)
        exported = self.facts.export.get("fps")
        if exported not in (None, info["fps"]):
            yield f"{path}: fps: {exported} rows a second were exported, found {info['fps']}"

    def _feature_faults(self, path: str) -> Iterator[str]:
        features = self._info["features"]
        for name, dtype in ROW_COLUMNS.items():
            if features.get(name, {}).get("dtype") != dtype:
                yield f"{path}: features: expected '{name}' of type {dtype}"
        exported = self.facts.export
        for key, names in exported.get("features", {}).items():
            if key not in features:
                yield f"{path}: features: '{key}' was exported and is missing"
            elif features[key].get("names") != names:
                yield f"{path}: features: '{key}' is of {features[key].get('names')}, was exported as {names}"
        for key, shape in exported.get("cameras", {}).items():
            if key not in features:
                yield f"{path}: features: '{key}' was exported and is missing"
            elif features[key]["shape"] != shape:
                yield f"{path}: features: '{key}' is of {features[key]['shape']}, was exported as {shape}"
        for key, feature in features.items():
            names, shape = feature.get("names"), feature["shape"]
            if isinstance(names, list) and len(shape) == 1 and len(names) != shape[0]:
                yield f"{path}: features: '{key}' has {len(names)} names for shape {shape}"

    # --- tasks and episodes

    def task_faults(self) -> Iterator[str]:
        """Checks `meta/tasks.parquet`."""
        path = "meta/tasks.parquet"
        try:
            columns = read_parquet(self._folder / path).to_pydict()
            texts = next(each for key, each in columns.items() if key != "task_index")
            self._tasks = {int(number): str(text) for number, text in zip(columns["task_index"], texts)}
        except (ValueError, KeyError, StopIteration, TypeError) as error:
            yield f"{path}: {_unreadable(error)}"
            return
        if len(self._tasks) != self._info["total_tasks"]:
            yield f"meta/info.json: total_tasks: {self._info['total_tasks']}, but {path} has {len(self._tasks)}"
        if sorted(self._tasks) != list(range(len(self._tasks))):
            yield f"{path}: expected task_index from 0 on without gaps, found {sorted(self._tasks)}"

    def episode_faults(self) -> Iterator[str]:
        """Checks `meta/episodes`."""
        paths = sorted((self._folder / "meta/episodes").glob("*/*.parquet"))
        if not paths:
            yield "meta/episodes: there is no file"
        rows: list[dict[str, Any]] = []
        for path in paths:
            try:
                rows += read_parquet(path).to_pylist()
            except ValueError as error:
                yield f"{path.relative_to(self._folder)}: {_unreadable(error)}"
        needed = {"episode_index", "length", "tasks", "dataset_from_index", "dataset_to_index"}
        needed |= {"data/chunk_index", "data/file_index"}
        if rows and (missing := needed - rows[0].keys()):
            yield f"meta/episodes: expected {', '.join(sorted(missing))}, found none"
            return
        self.episodes = rows
        indices = [row["episode_index"] for row in rows]
        if indices != list(range(len(rows))):
            yield f"meta/episodes: expected episode_index from 0 on without gaps, found {indices[:20]}"
        total, frames = self._info["total_episodes"], self._info["total_frames"]
        if total != len(rows):
            yield f"meta/info.json: total_episodes: {total}, but meta/episodes has {len(rows)}"
        if (found := sum(row["length"] for row in rows)) != frames:
            yield f"meta/info.json: total_frames: {frames}, but the lengths in meta/episodes sum up to {found}"
        yield from self._split_faults(len(rows))
        begin = 0
        for row in rows:
            start, stop, where = row["dataset_from_index"], row["dataset_to_index"], f"episode {row['episode_index']}"
            if start != begin or stop - start != row["length"]:
                expected = f"{begin} to {begin + row['length']}"
                yield f"meta/episodes: {where}: expected its rows at {expected}, found {start} to {stop}"
            begin += row["length"]
            for task in set(row["tasks"]) - set(self._tasks.values()):
                yield f"meta/episodes: {where}: its task '{task}' is not in meta/tasks.parquet"
            self._stored[row["episode_index"]] = stored = self.facts.episode(row["episode_index"])
            if stored.get("frames", row["length"]) != row["length"]:
                yield f"meta/episodes: {where}: {stored['frames']} frames were exported, found length {row['length']}"
            yield from self.facts.chain_faults(row["episode_index"], stored)

    def _split_faults(self, episodes: int) -> Iterator[str]:
        for name, split in self._info.get("splits", {}).items():
            first, _, last = str(split).partition(":")
            if not (first.isdecimal() and last.isdecimal() and int(first) <= int(last) <= episodes):
                yield f"meta/info.json: splits: '{name}' is {split}, there are {episodes} episodes"

    # --- data

    def data_faults(self) -> Iterator[str]:
        """Checks the rows of all episodes."""
        by_file: dict[str, list[dict[str, Any]]] = {}
        for row in self.episodes:
            place = {"chunk_index": row["data/chunk_index"], "file_index": row["data/file_index"]}
            try:
                name = file_name(self._info["data_path"], place)
            except ValueError as error:
                yield f"meta/info.json: data_path: {error}"
                return
            by_file.setdefault(name, []).append(row)
        on_disk = {str(path.relative_to(self._folder)) for path in (self._folder / "data").glob("*/*")}
        for name in sorted(on_disk - by_file.keys()):
            yield f"{name}: no episode is in it, says meta/episodes"
        for name, rows in by_file.items():
            if name not in on_disk:
                yield f"{name}: is missing"
                continue
            try:
                table = read_parquet(self._folder / name)
            except ValueError as error:
                yield f"{name}: {_unreadable(error)}"
                continue
            for fault in self._table_faults(table, rows):
                yield f"{name}: {fault}"

    def _table_faults(self, table: pa.Table, rows: list[dict[str, Any]]) -> Iterator[str]:
        """Checks a data file.

        Args:
            table: Content of the data file.
            rows: Rows of `meta/episodes` of the episodes that should be in the file, in order.
        """
        features = {key: each for key, each in self._info["features"].items() if each["dtype"] != "video"}
        for key in sorted(features.keys() - set(table.column_names)):
            yield f"'{key}' of meta/info.json is missing"
        for key in sorted(set(table.column_names) - features.keys()):
            yield f"'{key}' is not in meta/info.json"
        columns: dict[str, Array] = {}
        for key in table.column_names:
            if key in features and features[key]["dtype"] not in NO_NUMBERS:
                try:
                    columns[key] = matrix(table.column(key))
                except ValueError as error:
                    yield f"'{key}': {error}"
                    continue
                yield from _type_faults(key, features[key], columns[key])
        lengths = sum(row["length"] for row in rows)
        if len(table) != lengths:
            yield f"{len(table)} rows, but meta/episodes has {lengths} for its episodes"
        begin = 0
        for row in rows:
            part = {key: each[begin : begin + row["length"]] for key, each in columns.items()}
            begin += row["length"]
            for fault in self._row_faults(row, part):
                yield f"episode {row['episode_index']}: {fault}"
        for key, each in columns.items():
            self._values.setdefault(key, []).append(each)

    def _row_faults(self, row: Mapping[str, Any], columns: Mapping[str, Array]) -> Iterator[str]:
        count, index, fps = row["length"], row["episode_index"], self._info["fps"]
        start = row["dataset_from_index"]
        expected = {"frame_index": np.arange(count), "episode_index": np.full(count, index)}
        expected["index"] = np.arange(start, start + count)
        for key, wanted in expected.items():
            found = columns.get(key)
            if found is not None and len(found) == count and (wrong := np.flatnonzero(found[:, 0] != wanted)).size:
                first = wrong[0]
                yield f"{key}: expected {wanted[first]} in frame {first}, found {found[first, 0]}"
        yield from self._timestamp_faults(columns.get("timestamp"), fps)
        tasks = {key for key in np.unique(columns["task_index"])} if "task_index" in columns else set()
        for task in sorted(tasks):
            if int(task) not in self._tasks:
                yield f"task_index: {task} is not in meta/tasks.parquet"
            elif self._tasks[int(task)] not in row["tasks"]:
                yield f"task_index: '{self._tasks[int(task)]}' is not a task of it in meta/episodes"
        stored = self._stored.get(index, {})
        for key, values in columns.items():
            names = self._info["features"][key].get("names") or [str(number) for number in range(values.shape[1])]
            if key not in ROW_COLUMNS:
                for fault in feature_faults(key, names, values, stored):
                    yield f"'{key}': {fault}"

    def _timestamp_faults(self, stamps: Array | None, fps: float) -> Iterator[str]:
        if stamps is None or not len(stamps):
            return
        errors = stamps[:, 0].astype(float) - np.arange(len(stamps)) / fps
        if not np.isfinite(errors).all():
            yield "timestamp: is not finite"
        elif np.abs(errors - 1 / fps).max() < MAX_TIME_ERROR_S:
            yield "timestamp: is late by one frame"
        elif np.abs(errors).max() > MAX_TIME_ERROR_S:
            first = int(np.argmax(np.abs(errors) > MAX_TIME_ERROR_S))
            found = float(stamps[first, 0])
            yield f"timestamp: expected {first / fps:.6g} s in frame {first} ({fps} fps), found {found:.6g} s"

    # --- meta/stats.json

    def statistics_faults(self) -> Iterator[str]:
        """Compares the stored statistics of all features with the values."""
        path = "meta/stats.json"
        try:
            stats = read_json(self._folder, path)
        except ValueError as error:
            yield f"{path}: {_unreadable(error)}"
            return
        for key in sorted(self._info["features"].keys() - stats.keys() - ROW_COLUMNS.keys()):
            yield f"{path}: nothing for '{key}'"
        for key, parts in self._values.items():
            if key not in stats or len({part.shape[1] for part in parts}) != 1:
                continue
            values = np.concatenate(parts)
            if not len(values) or not np.isfinite(values.astype(float)).all():
                continue
            yield from (f"{path}: '{key}': {fault}" for fault in _statistic_faults(stats[key], values))

    # --- videos

    def video_faults(self) -> Iterator[str]:
        """Checks the videos of all cameras and episodes."""
        features = {key: each for key, each in self._info["features"].items() if each["dtype"] == "video"}
        for key, feature in features.items():
            columns = [
                f"videos/{key}/{name}" for name in ("chunk_index", "file_index", "from_timestamp", "to_timestamp")
            ]
            by_file: dict[str, list[dict[str, Any]]] = {}
            for row in self.episodes:
                if missing := [column for column in columns if row.get(column) is None]:
                    yield f"meta/episodes: episode {row['episode_index']}: expected {', '.join(missing)}, found none"
                    continue
                place = {"video_key": key, "chunk_index": row[columns[0]], "file_index": row[columns[1]]}
                try:
                    name = file_name(self._info.get("video_path") or VIDEO_PATH, place)
                except ValueError as error:
                    yield f"meta/info.json: video_path: {error}"
                    return
                by_file.setdefault(name, []).append(row)
            for name, rows in by_file.items():
                for fault in self._file_faults(self._folder / name, key, feature, rows):
                    yield f"{name}: {fault}"
        on_disk = {path.parent.parent.name for path in (self._folder / "videos").glob("*/*/*.mp4")}
        for key in sorted(on_disk - features.keys()):
            yield f"videos/{key}: '{key}' is not in meta/info.json"

    def _file_faults(
        self, path: Path, key: str, feature: Mapping[str, Any], rows: list[dict[str, Any]]
    ) -> Iterator[str]:
        """Checks a video file.

        Args:
            path: The video file.
            key: Key of the camera.
            feature: Description of the camera in `meta/info.json`.
            rows: Rows of `meta/episodes` of the episodes that should be in the video.
        """
        from rpbi_data.datasets.video import VideoFacts, read_video  # not needed without cameras

        if not path.exists():
            yield f"is missing, with the images of episodes {', '.join(str(row['episode_index']) for row in rows)}"
            return
        fps = self._info["fps"]
        try:
            facts = VideoFacts(path)
        except ValueError as error:
            yield str(error)
            return
        shape = feature["shape"]
        if [facts.height, facts.width] != list(shape[:2]):
            yield f"{facts.width} x {facts.height} pixels, but meta/info.json has the shape {shape}"
        if abs(facts.fps - fps) > 1e-3 * fps:
            yield f"{facts.fps:g} frames a second, but meta/info.json has {fps:g}"
        times: list[float] = []
        images: list[Array] = []
        try:
            for time_s, pixels in read_video(path):
                times.append(time_s)
                images.append(coarse(pixels))
        except ValueError as error:
            yield str(error)
            return
        expected = sum(row["length"] for row in rows)
        if len(times) != expected:
            yield f"{len(times)} frames, but its episodes have {expected} rows"
        yield from self._frame_faults(key, rows, np.array(times), np.array(images))

    def _frame_faults(self, key: str, rows: list[dict[str, Any]], times: Array, images: Array) -> Iterator[str]:
        """Finds the frames of each episode by time, as LeRobot's reader does, and checks the frames.

        Args:
            key: Key of the camera.
            rows: Rows of `meta/episodes` of the episodes in the video.
            times: Times of the frames, shape (n,) [s].
            images: Coarse images of the frames, shape (n, 8, 8, 3).
        """
        fps = self._info["fps"]
        for row in rows:
            where = f"episode {row['episode_index']}"
            start, stop = (row[f"videos/{key}/{name}"] for name in ("from_timestamp", "to_timestamp"))
            if abs((stop - start) * fps - row["length"]) > 0.5:
                yield f"{where}: {start:g} s to {stop:g} s in meta/episodes is not the time of {row['length']} frames"
            wanted = start + np.arange(row["length"]) / fps
            if not len(times) or np.abs(times[_nearest(times, wanted)] - wanted).max() > MAX_TIME_ERROR_S:
                yield f"{where}: no frame at each of its times from {start:g} s on"
                continue
            found = images[_nearest(times, wanted)]
            if not self._stored.get(row["episode_index"]):
                yield from (f"{where}: {fault}" for fault in frozen_faults(found, self._states(row)))
                continue
            try:
                stored = read_images(self._folder, row["episode_index"])
            except ValueError as error:
                yield f"{where}: {error}"
                continue
            yield from (f"{where}: {fault}" for fault in image_faults(key, found, stored))

    def _states(self, row: Mapping[str, Any]) -> Array:
        """Returns `observation.state` of an episode, shape (length, columns); empty if the feature is missing."""
        parts = self._values.get(STATE, [])
        if not parts or len({part.shape[1] for part in parts}) != 1:
            return np.empty((0, 0))
        return np.concatenate(parts)[row["dataset_from_index"] : row["dataset_to_index"]]


def _is_feature(feature: Any) -> bool:
    return (
        isinstance(feature, dict) and isinstance(feature.get("shape"), list) and isinstance(feature.get("dtype"), str)
    )


def _unreadable(error: Exception) -> str:
    return f"cannot be read: {' '.join(str(error).removeprefix('cannot be read: ').split())}"


def _type_faults(key: str, feature: Mapping[str, Any], values: Array) -> Iterator[str]:
    if math.prod(feature["shape"]) != values.shape[1]:
        yield f"'{key}' has {values.shape[1]} numbers a row, but meta/info.json has the shape {feature['shape']}"
    if str(values.dtype) != feature["dtype"]:
        yield f"'{key}' is of type {values.dtype}, but meta/info.json has {feature['dtype']}"


def _statistic_faults(stored: Mapping[str, Any], values: Array) -> Iterator[str]:
    """Compares the stored statistics of a feature with statistics of the values."""
    found = statistics(values)
    scale = np.maximum(np.abs(values.astype(float)).max(axis=0), 1e-6)
    for name in ("min", "max", "mean", "std"):
        if name not in stored:
            yield f"{name} is missing"
            continue
        wanted, got = np.ravel(stored[name]).astype(float), np.array(found[name], float)
        if wanted.shape != got.shape:
            yield f"{name}: {len(wanted)} numbers for {len(got)} columns"
            continue
        wrong = np.flatnonzero(~(np.abs(wanted - got) <= MAX_STATISTIC_ERROR * scale))
        if len(wrong):
            column = wrong[0]
            yield f"{name}: {wanted[column]:.6g} in column {column}, but that of the values is {got[column]:.6g}"
    if "count" in stored and np.ravel(stored["count"]).tolist() != [len(values)]:
        yield f"count: {np.ravel(stored['count']).tolist()} for {len(values)} rows"


def _nearest(times: Array, wanted: Array) -> Array:
    """Returns, for each wanted time, the index of the nearest time. `times` must be ascending and not empty."""
    right = np.clip(np.searchsorted(times, wanted), 1, max(len(times) - 1, 1))
    right = np.minimum(right, len(times) - 1)
    left = np.maximum(right - 1, 0)
    return np.where(wanted - times[left] <= times[right] - wanted, left, right)
