"""Data set format LeRobot, version 3.0."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pandas as pd
from pydantic import Field

from custom_ros_tools.errors import MissingDependency
from custom_ros_tools.schema import ConfigModel
from rpbi_data.datasets.coarse_images import coarse
from rpbi_data.datasets.format import Array, CameraFeature, DatasetFormat, ExportedEpisode, Schema, require_room
from rpbi_data.datasets.provenance import checksums
from rpbi_data.datasets.statistics import ImageStatistics, pooled, statistics

from .lerobot_check import (
    CHUNK,
    DATA_PATH,
    EPISODES_PATH,
    ROW_COLUMNS,
    VERSION,
    VIDEO_PATH,
    data_file,
    lerobot_faults,
    matrix,
    place,
    video_file,
)

try:
    import pyarrow as pa
    from pyarrow import parquet
except ImportError:
    raise MissingDependency("pyarrow", "./rpbi setup data") from None

MAX_DATA_BYTES = 100_000_000
"""Size of the rows in memory above which they are written to a data file [bytes]."""
ROOM_BYTES = 200_000
"""Disk space that is reserved for metadata, in addition to the space for rows [bytes]."""
Preset = Literal["ultrafast", "superfast", "veryfast", "faster", "fast", "medium", "slow", "slower", "veryslow"]


class LeRobotConfig(ConfigModel):
    """Options of LeRobot data sets."""

    preset: Preset = Field("veryfast", description="Speed preset of the video encoder.")
    crf: int = Field(
        23,
        ge=0,
        le=51,
        description="Constant rate factor of the video encoder; smaller values give better pictures and larger files.",
    )
    robot_type: str = Field("", description="Name of the robot in the data set.")


class LeRobot(DatasetFormat):
    """Format LeRobot 3.0: Parquet files with a row group per episode, and an MP4 video per episode and camera."""

    Config = LeRobotConfig
    content = "meta/info.json (LeRobot)"

    def open(self, folder: Path, schema: Schema | None) -> None:
        """Starts the data set."""
        assert schema is not None
        self._folder, self._schema = folder, schema
        self._tasks: dict[str, int] = {}
        self._episodes: list[dict[str, Any]] = []
        self._pending: list[pa.Table] = []
        self._image_statistics: dict[str, list[dict[str, list[Any]]]] = {each.key: [] for each in schema.cameras}
        self._frames = 0
        self._data_file = 0

    def add(self, index: int, episode: ExportedEpisode) -> dict[str, Any]:
        """Writes the videos of an episode. The rows are kept in memory until they fill a data file."""
        if sum(each.nbytes for each in self._pending) > MAX_DATA_BYTES:
            self._write_rows()
            self._pending = []
            self._data_file += 1
        count = len(episode.times)
        films, values = self._write_videos(index, episode)
        task = self._tasks.setdefault(episode.task, len(self._tasks))
        rows = self._rows(index, task, count, values)
        self._episodes.append(self._episode(index, episode.task, rows, films))
        for key, film in films.items():
            self._image_statistics[key].append(film.statistics)
        self._frames += count
        self._pending.append(rows)
        columns = {
            feature.key: {"names": list(feature.names), "checksums": checksums(values[feature.key])}
            for feature in self._schema.features
        }
        images = {key: film.coarse for key, film in films.items()}
        return {"frames": count, "fps": self._schema.fps, "columns": columns, "images": images}

    def take_back(self, index: int) -> None:
        """Removes the episode that was added last, whose rows are still in memory."""
        self._frames -= len(self._pending.pop())
        self._episodes.pop()
        for key, found in self._image_statistics.items():
            found.pop()
            (self._folder / video_file(key, index)).unlink()
        if not self._pending:
            (self._folder / data_file(self._data_file)).unlink(missing_ok=True)

    def close(self) -> None:
        """Writes the remaining rows and all metadata."""
        if self._pending:
            self._write_rows()
        fps = self._schema.fps
        features = {each.key: _feature(each.dtype, each.names) for each in self._schema.features}
        features |= {each.key: self._video_feature(each) for each in self._schema.cameras}
        features |= {name: _feature(dtype, None) for name, dtype in ROW_COLUMNS.items()}
        info = {
            "codebase_version": VERSION,
            "robot_type": self.config.robot_type or None,
            "total_episodes": len(self._episodes),
            "total_frames": self._frames,
            "total_tasks": len(self._tasks),
            "chunks_size": CHUNK,
            "data_files_size_in_mb": MAX_DATA_BYTES // 1_000_000,
            "video_files_size_in_mb": 200,
            "fps": fps,
            "splits": {"train": f"0:{len(self._episodes)}"},
            "data_path": DATA_PATH,
            "video_path": VIDEO_PATH if self._schema.cameras else None,
            "features": features,
        }
        meta = self._folder / "meta"
        tasks = pd.DataFrame({"task_index": list(self._tasks.values())}, index=pd.Index(self._tasks, name="task"))
        _parquet(meta / "tasks.parquet", [pa.Table.from_pandas(tasks)])
        _parquet(self._folder / EPISODES_PATH, [pa.Table.from_pylist(self._episodes)])
        _json(meta / "stats.json", self._all_statistics())
        _json(meta / "info.json", info)

    def _write_videos(self, index: int, episode: ExportedEpisode) -> tuple[dict[str, _Film], dict[str, Array]]:
        """Writes the videos of an episode. Returns a `_Film` per camera and the features' values, indexed by key."""
        paths = {each.key: self._folder / video_file(each.key, index) for each in self._schema.cameras}
        with ExitStack() as undo:
            for path in paths.values():
                undo.callback(path.unlink, missing_ok=True)
            films = {each.key: self._write_video(paths[each.key], each, episode) for each in self._schema.cameras}
            values = episode.values({key: film.stamps for key, film in films.items()})
            rows = sum(each.nbytes for each in (*self._pending, *values.values()))
            require_room(self._folder, 2 * rows + ROOM_BYTES)  # for the rows, which are written later
            undo.pop_all()
        return films, values

    def _episode(self, index: int, task: str, rows: pa.Table, films: Mapping[str, _Film]) -> dict[str, Any]:
        """Returns the row that describes an episode in `meta/episodes`."""
        count = len(rows)
        facts: dict[str, Any] = {"episode_index": index, "tasks": [task], "length": count}
        facts |= {"dataset_from_index": self._frames, "dataset_to_index": self._frames + count}
        facts |= {f"data/{name}": number for name, number in place(self._data_file).items()}
        for key in films:
            facts |= {f"videos/{key}/{name}": number for name, number in place(index).items()}
            facts |= {f"videos/{key}/from_timestamp": 0.0, f"videos/{key}/to_timestamp": count / self._schema.fps}
        facts |= {f"meta/episodes/{name}": number for name, number in place(0).items()}
        by_feature = {key: statistics(matrix(rows.column(key))) for key in rows.column_names}
        for key, each in (by_feature | {key: film.statistics for key, film in films.items()}).items():
            facts |= {f"stats/{key}/{name}": value for name, value in each.items()}
        return facts

    def _write_video(self, path: Path, camera: CameraFeature, episode: ExportedEpisode) -> _Film:
        from rpbi_data.datasets.video import VideoWriter  # not needed without cameras

        path.parent.mkdir(parents=True, exist_ok=True)
        film = _Film(len(episode.times))
        preset, crf = self.config.preset, self.config.crf
        with VideoWriter(path, self._schema.fps, camera.height, camera.width, preset, crf) as video:
            for pixels, stamp in episode.frames(camera.key):
                video.add(pixels)
                film.add(pixels, stamp)
        return film

    def _rows(self, index: int, task: int, count: int, values: Mapping[str, Array]) -> pa.Table:
        arrays = {each.key: _array(values[each.key]) for each in self._schema.features}
        frames = np.arange(count)
        own = {
            "timestamp": (frames / self._schema.fps).astype(np.float32),
            "frame_index": frames,
            "episode_index": np.full(count, index),
            "index": self._frames + frames,
            "task_index": np.full(count, task),
        }
        return pa.table(arrays | {name: pa.array(each) for name, each in own.items()})

    def _write_rows(self) -> None:
        _parquet(self._folder / data_file(self._data_file), self._pending)

    def _all_statistics(self) -> dict[str, Any]:
        files = [self._folder / data_file(number) for number in range(self._data_file + bool(self._pending))]
        found = {}
        for key in (*(each.key for each in self._schema.features), *ROW_COLUMNS):
            columns = [matrix(parquet.read_table(file, columns=[key]).column(key)) for file in files]
            found[key] = statistics(np.concatenate(columns))
        return found | {key: pooled(parts) for key, parts in self._image_statistics.items()}

    def _video_feature(self, camera: CameraFeature) -> dict[str, Any]:
        info = {
            "video.height": camera.height,
            "video.width": camera.width,
            "video.codec": "h264",
            "video.pix_fmt": "yuv420p",
            "video.is_depth_map": False,
            "video.fps": self._schema.fps,
            "video.channels": 3,
            "has_audio": False,
        }
        shape = [camera.height, camera.width, 3]
        return {"dtype": "video", "shape": shape, "names": ["height", "width", "channels"], "info": info}

    @classmethod
    def recognises(cls, folder: Path) -> bool:
        """Returns True if a folder contains the file `meta/info.json`, or both of the folders `meta` and `data`."""
        return (folder / "meta").is_dir() and ((folder / "meta/info.json").exists() or (folder / "data").is_dir())

    @classmethod
    def faults(cls, folder: Path) -> Iterator[str]:
        """Yields a message for each fault."""
        return lerobot_faults(folder)

    @classmethod
    def summary(cls, folder: Path) -> str:
        """Returns a text with the version and the numbers of episodes and frames."""
        info = json.loads((folder / "meta/info.json").read_text(encoding="utf-8"))
        return f"LeRobot {info['codebase_version']}: {info['total_episodes']} episodes, {info['total_frames']} frames"


class _Film:
    """Collects stamps, statistics and coarse images of one camera's images in one episode."""

    def __init__(self, frames: int) -> None:
        self._statistics = ImageStatistics(frames)
        self._stamps: list[int] = []
        self._coarse: list[Array] = []

    def add(self, pixels: Array, stamp: int) -> None:
        """Adds an image, shape (height, width, 3), uint8, with its stamp [ns]."""
        self._statistics.add(pixels)
        self._stamps.append(stamp)
        self._coarse.append(coarse(pixels))

    @property
    def stamps(self) -> Array:
        """Stamps of the images, shape (n,) [ns]."""
        return np.array(self._stamps)

    @property
    def coarse(self) -> Array:
        """Coarse images, shape (n, 8, 8, 3), float16."""
        return np.array(self._coarse, np.float16)

    @property
    def statistics(self) -> dict[str, list[Any]]:
        """Statistics of the channels, see `ImageStatistics.result`."""
        return self._statistics.result()


def _feature(dtype: str, names: tuple[str, ...] | None) -> dict[str, Any]:
    return {"dtype": dtype, "shape": [1 if names is None else len(names)], "names": list(names) if names else None}


def _array(values: Array) -> pa.Array:
    """Converts values, shape (n, columns), to an Arrow array of lists, or of numbers if there is only one column."""
    if values.shape[1] == 1:
        return pa.array(values[:, 0])
    return pa.FixedSizeListArray.from_arrays(pa.array(values.ravel()), values.shape[1])


def _parquet(path: Path, tables: list[pa.Table]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with parquet.ParquetWriter(path, tables[0].schema, compression="snappy") as writer:
        for table in tables:
            writer.write_table(table, row_group_size=max(1, len(table)))


def _json(path: Path, data: Mapping[str, Any]) -> None:
    path.write_text(json.dumps(data, indent=4, ensure_ascii=False), encoding="utf-8")
