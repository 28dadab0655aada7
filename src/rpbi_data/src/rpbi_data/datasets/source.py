"""Computes the rows of a data set, at a constant rate, from the bag of an episode."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from custom_ros_tools.errors import ConfigError
from robot_model.urdf.document import UrdfDocument
from rpbi_data.bags.bag_reader import BagMessage, BagReader, bag_to_dataframes
from rpbi_data.bags.images import decode_image
from rpbi_data.bags.resampling import TIME_ERROR as RESAMPLING_ERROR
from rpbi_data.bags.resampling import resample_exactly
from rpbi_data.bags.times import MAX_BACK_S, PER_SECOND, ClockStep, clock_of, row_times, to_seconds
from rpbi_data.bags.topic_report import message_time_ns
from rpbi_data.episodes.files import URDF, stored_path
from rpbi_data.episodes.folder import BAG, Episode, EpisodeFolder

from .actions import action_values, derive_actions
from .format import (
    ACTION,
    QUATERNION,
    STAMP,
    TIME_ERROR,
    Array,
    CameraFeature,
    DatasetError,
    ExportedEpisode,
    Feature,
    ImageFrame,
    Schema,
    stamps_of,
)
from .provenance import file_digest, hash_chain
from .signals import RowOptions, Signal, by_frame, derive, end_effector_columns, image_topics, is_used, wanted_topics


class Cut(NamedTuple):
    """Start of the rows in an episode in which the world was reset.

    Attributes:
        resets: Number of resets within the episode.
        stamp_ns: Stamp of the first state after the last reset [ns].
    """

    resets: int
    stamp_ns: int


class SourceEpisode(ExportedEpisode):
    """A recorded episode, resampled at the rate of a schema.

    Args:
        folder: Folder that contains the episode.
        episode: Description of the episode.
        row_options: The user's choice of the content of rows.
        task: Description of the task in words.
        any_size: Whether the bag may exceed the limits of `BagReader`.
        max_time_error_s: Largest time between a row and the nearest message of an observation [s].
        has_rows: Whether rows are exported. If False, only the simulator's states are read.
    """

    def __init__(
        self,
        folder: EpisodeFolder,
        episode: Episode,
        row_options: RowOptions,
        task: str,
        any_size: bool = False,
        max_time_error_s: float = np.inf,
        has_rows: bool = True,
    ) -> None:
        self.folder, self.episode, self.task, self.label = folder, episode, task, episode.label
        self.bag: Path = folder.folder_of(episode.number) / BAG
        self._row_options, self._any_size, self._max_time_error_s = row_options, any_size, max_time_error_s
        self._has_rows = has_rows
        self._schema = Schema(0, ())
        self._signals: tuple[Signal, ...] = ()

    def check(self) -> None:
        """Opens and closes the bag; raises a BagError if the bag cannot be read within the limits."""
        BagReader(self.bag, any_size=self._any_size).__exit__()

    @property
    def table_bytes(self) -> int:
        """Memory of the loaded tables [bytes]; 0 if no table is loaded."""
        made = [self.__dict__.get(name, {}) for name in ("_recorded", "_tables")]
        tables = {id(table): table for each in made for table in each.values()}
        return sum(int(table.memory_usage().sum()) for table in tables.values())

    def release(self) -> None:
        """Releases the memory of the tables. The tables are read again when they are next used."""
        for name in ("_recorded", "_tables", "times"):
            self.__dict__.pop(name, None)

    @cached_property
    def signals(self) -> tuple[Signal, ...]:
        """The features of the recorded topics: observations, and the action if there is one.

        Raises:
            BagError: If the bag cannot be read.
            UnknownNameError: If a topic, feature, frame or joint that the user chose is not in the recording.
            ValueError: If the user requests changes as actions, but the commands are not joint positions.
        """
        row_options, namespace, fixed = self._row_options, self.episode.namespace, self._fixed_joints()
        pose = end_effector_columns(self._tables, namespace, row_options.end_effector) if row_options.is_pose else ()
        observations = derive(self._tables, self._types, namespace, fixed, row_options)
        return (*observations, *derive_actions(self._tables, self._types, fixed, row_options, pose))

    @cached_property
    def cut(self) -> Cut | None:
        """The last reset of the world, after which rows begin; None if the world was not reset within the episode."""
        states = self._recorded.get(self._state_topic)
        if states is None:
            return None
        resets = states["resets"].to_numpy() if "resets" in states else np.empty(0)
        if not len(resets) or resets[0] == resets[-1]:
            return None
        return Cut(int(resets[-1] - resets[0]), int(states.index[np.argmax(resets == resets[-1])]))

    @property
    def cameras(self) -> tuple[CameraFeature, ...]:
        """The recorded cameras with 8 bits per channel.

        Cameras with other images are left out. If the user chose such a camera, a DatasetError is raised.
        """
        return tuple(camera for camera, _ in self._cameras.values())

    @cached_property
    def _cameras(self) -> dict[str, tuple[CameraFeature, int]]:
        """Pairs of a camera and the stamp of its first image [ns], indexed by the camera's key."""
        found = {}
        for key, topic in self._image_topics.items():
            first = next(self._images(topic), None)
            if first is None:
                continue
            try:
                pixels = _rgb(first[0]())
            except ValueError as error:
                if self._row_options.images is not None:
                    raise DatasetError(self.bag, f"{topic}: {error}") from error
                continue
            found[key] = CameraFeature(key, pixels.shape[0], pixels.shape[1]), first[1]
        return found

    def use(self, schema: Schema, signals: Sequence[Signal]) -> None:
        """Sets the content of the rows that `times`, `frames` and `values` return.

        Args:
            schema: Rate and features of the rows.
            signals: The features of the schema that consist of numbers, with the columns from which they are computed.

        Raises:
            DatasetError: If the recording lacks a feature or a camera, or if names or image sizes differ.
        """
        here = {signal.feature.key: signal for signal in self.signals}
        for signal in signals:
            if signal.feature.key not in here:
                raise DatasetError(self.bag, f"no messages for '{signal.feature.key}', which other episodes have")
            if here[signal.feature.key].feature != signal.feature:
                others, own = (", ".join(each.feature.names) for each in (signal, here[signal.feature.key]))
                raise DatasetError(self.bag, f"'{signal.feature.key}' is of {own}, in other episodes of {others}")
        for camera in schema.cameras:
            if camera not in self.cameras:
                size = f"{camera.width} x {camera.height} pixels"
                raise DatasetError(self.bag, f"no images for '{camera.key}' of {size}, which other episodes have")
        self._schema, self._signals = schema, tuple(signals)

    @cached_property
    def times(self) -> Array:
        """Times of the rows, int64, shape (n,) [ns]. All features except actions have values at these times.

        Raises:
            DatasetError: If there are fewer than two rows.
        """
        tables = {name: self._tables[name] for name in self._continuous_tables()}
        starts = [table.index[0] for table in tables.values()]
        starts += [self._cameras[camera.key][1] for camera in self._schema.cameras]
        start, end = max(starts), min(table.index[-1] for table in tables.values())
        times = row_times(int(start), int(end), self._schema.fps) if end > start else np.empty(0, np.int64)
        if len(times) < 2:
            last = max(tables, key=lambda name: tables[name].index[0])
            raise DatasetError(self.bag, f"its topics have no time in common; the last one to begin is {last}")
        return times

    def frames(self, key: str) -> Iterator[ImageFrame]:
        """Yields, for each row, the newest image of a camera at the time of the row."""
        (camera,) = (each for each in self._schema.cameras if each.key == key)
        topic = self._image_topics[key]
        images = self._images(topic)
        coming = next(images, None)
        shown: ImageFrame | None = None
        newest = coming
        for time_ns in self.times.tolist():
            while coming is not None and coming[1] <= time_ns:
                newest, coming = coming, next(images, None)
            assert newest is not None
            if shown is None or newest[1] != shown.stamp:
                try:
                    pixels = _rgb(newest[0]())
                except ValueError as error:
                    raise DatasetError(self.bag, f"{topic}: the image at {to_seconds(newest[1])} s: {error}") from error
                if pixels.shape[:2] != camera[1:]:
                    got, expected = (f"{width} x {height}" for height, width in (pixels.shape[:2], camera[1:]))
                    at = f"the image at {to_seconds(newest[1])} s"
                    raise DatasetError(self.bag, f"{topic}: {at}: expected {expected}, got {got}")
                shown = ImageFrame(pixels, newest[1])
            yield shown

    def values(self, image_stamps: Mapping[str, Array]) -> dict[str, Array]:
        """Returns the values of all numeric features at the times of the rows, indexed by feature key."""
        values: dict[str, Array] = {}
        errors: dict[str, Array] = {}
        for signal in self._signals:
            key = signal.feature.key
            values[key], errors[key] = self._resampled(signal)
            if not np.isfinite(values[key]).all():
                raise DatasetError(self.bag, f"'{key}' has values that are not finite")
        errors |= {key: (self.times - stamps) / 1e9 for key, stamps in image_stamps.items()}
        self._require_near(errors)
        values[STAMP] = stamps_of(self.times)
        values[TIME_ERROR] = np.stack(list(errors.values()), axis=1).astype(np.float32)
        return values

    def facts(self) -> dict[str, Any]:
        """Returns metadata of the episode for the data set, such as its source and its chain of state hashes."""
        episode = self.episode
        chain = hash_chain(self._states())
        source = {"folder": str(self.folder.path), "episode": episode.number, "bag_sha256": file_digest(self.bag)}
        source |= {"label": episode.label, "started": episode.started, "seeds": episode.seeds, "git": episode.git}
        source["versions"] = episode.versions
        return {
            "source": source,
            "task": self.task,
            "state_hashes": {"chain": chain, "last": chain[-1]["link"] if chain else ""},
            **(
                {"cut": {"resets": self.cut.resets, "stamp_ns": self.cut.stamp_ns}}
                if self._signals and self.cut
                else {}
            ),
        }

    def _require_near(self, errors: Mapping[str, Array]) -> None:
        for key, error in errors.items():
            row = int(np.argmax(error))
            if key != ACTION and error[row] > self._max_time_error_s:
                at = f"{error[row]:.3g} s from the row at {to_seconds(self.times[row])} s"
                raise DatasetError(self.bag, f"'{key}': the nearest message is {at}, more than --max-time-error")

    def _resampled(self, signal: Signal) -> tuple[Array, Array]:
        """Returns the values of a feature, shape (n, columns), and the time error of each row, shape (n,) [s].

        The time error is explained in `rpbi_data.resample`. For actions, it is the time between row and command.
        """
        if signal.feature.key == ACTION:
            end = self.times[0] + (2 * len(self.times) * PER_SECOND + self._schema.fps) // (2 * self._schema.fps)
            matrix, error = action_values(signal, self._tables, self.times, np.append(self.times[1:], end))
            _make_continuous(matrix, signal.feature)
            return matrix.astype(signal.feature.dtype), error
        by_table: dict[str, list[str]] = {}
        for table, name in signal.columns:
            by_table.setdefault(table, []).append(name)
        found = {
            table: resample_exactly(self._tables[table].reindex(columns=names), self.times, signal.method)
            for table, names in by_table.items()
        }
        columns = [found[table][name].to_numpy(float) for table, name in signal.columns]
        error = np.zeros(len(self.times))
        for table in found.values():
            error = np.fmax(error, table[RESAMPLING_ERROR].to_numpy(float))
        matrix = np.stack(columns, axis=1)
        _make_continuous(matrix, signal.feature)
        return matrix.astype(signal.feature.dtype), error.astype(np.float32)

    def _continuous_tables(self) -> list[str]:
        """Returns the names of the tables whose common time range determines the first and the last row."""
        signals = [signal for signal in self._signals if signal.begins_at_once] or self._signals
        return sorted({table for signal in signals for table, _ in signal.columns})

    @cached_property
    def _recorded(self) -> dict[str, pd.DataFrame]:
        """Tables of all needed topics, indexed by topic. The bag is read only once."""
        topics = {*self._feature_topics, *({self._state_topic} & self._types.keys())}
        return bag_to_dataframes(self.bag, topics, any_size=self._any_size, nanoseconds=True) if topics else {}

    @property
    def _feature_topics(self) -> list[str]:
        return wanted_topics(self._types, self._row_options) if self._has_rows else []

    @cached_property
    def _tables(self) -> dict[str, pd.DataFrame]:
        """Tables from which features are computed, as returned by `by_frame`, without rows before the last reset."""
        tables = {topic: self._recorded[topic] for topic in self._feature_topics}
        for topic, table in tables.items():
            self._require_steady(topic, clock_of(table.set_axis(to_seconds(table.index))))
        if (cut := self.cut) is not None:
            tables = {topic: table[table.index >= cut.stamp_ns] for topic, table in tables.items()}
        return by_frame({topic: table for topic, table in tables.items() if len(table)})

    @cached_property
    def _types(self) -> dict[str, str]:
        """Message types, indexed by topic.

        Raises:
            DatasetError: If a topic that is used for a feature has several types, or the topic's clock was set back.
        """
        found = {}
        with BagReader(self.bag, any_size=self._any_size) as bag:
            for topic, types in bag.types.items():
                kinds = sorted({each.name for each in types})
                if is_used(topic, kinds, self._row_options):
                    self._require_steady(topic, bag.clock_of(topic))
                    if len(kinds) > 1:
                        message = f"{topic}: expected messages of one type, got {' and '.join(kinds)}"
                        raise DatasetError(self.bag, message)
                found[topic] = "|".join(kinds)
        return found

    def _require_steady(self, topic: str, clock: ClockStep) -> None:
        if clock.is_fault:
            raise DatasetError(self.bag, f"{topic}: {clock}")

    @cached_property
    def _image_topics(self) -> dict[str, str]:
        return image_topics(self._types, self._row_options)

    def _images(self, topic: str) -> Iterator[tuple[Callable[[], Array], int]]:
        """Yields two values per image, ordered by stamp: a function that returns the pixels, and the stamp [ns]."""
        waiting: list[tuple[int, int, BagMessage]] = []
        with BagReader(self.bag, any_size=self._any_size) as bag:
            latest = 0
            for number, message in enumerate(bag.messages([topic])):
                stamp = message_time_ns(message)
                self._require_steady(topic, ClockStep(latest / 1e9, (latest - stamp) / 1e9))
                latest = max(latest, stamp)
                if self.cut is not None and stamp < self.cut.stamp_ns:
                    continue
                heapq.heappush(waiting, (stamp, number, message))
                while latest - waiting[0][0] > MAX_BACK_S * PER_SECOND:
                    yield _image(*heapq.heappop(waiting))
            while waiting:
                yield _image(*heapq.heappop(waiting))

    @property
    def _state_topic(self) -> str:
        return f"/{self.episode.namespace.strip('/')}/rpbi/state".replace("//", "/")

    def _states(self) -> Iterator[dict[str, Any]]:
        table = self._recorded.get(self._state_topic)
        if table is None or "state_hash" not in table:
            return
        for row in table[table["state_hash"].astype(bool)].itertuples():
            counts = {"resets": int(row.resets), "tick": int(row.tick), "commands": int(row.commands)}
            yield {"stamp": float(to_seconds(row.Index)), **counts, "hash": str(row.state_hash)}

    def _fixed_joints(self) -> set[str]:
        fixed: set[str] = set()
        movable: set[str] = set()
        for each in self.episode.files:
            if each["path"].lower().endswith(URDF) and each["sha256"]:
                with suppress(ConfigError):
                    copy = stored_path(self.folder.files, each["path"], each["sha256"])
                    for name, kind in UrdfDocument(str(copy)).joint_types.items():
                        (fixed if kind == "fixed" else movable).add(name)
        return fixed - movable


def _image(stamp: int, _: int, message: BagMessage) -> tuple[Callable[[], Array], int]:
    return (lambda: decode_image(message.type, message.raw)), stamp


def _rgb(pixels: Array) -> Array:
    """Converts pixels to red, green and blue, and crops them to an even number of rows and columns.

    Raises:
        ValueError: If the pixels do not have 8 bits per channel.
    """
    if pixels.dtype != np.uint8:
        raise ValueError(f"expected images of 8 bits a channel, got {pixels.dtype}")
    if pixels.ndim == 2:
        pixels = np.repeat(pixels[:, :, None], 3, axis=2)
    height, width = (size // 2 * 2 for size in pixels.shape[:2])
    return np.ascontiguousarray(pixels[:height, :width, :3])


def _make_continuous(values: Array, feature: Feature) -> None:
    """Flips signs of quaternions in place, so that each is nearest to the previous one and the first has w >= 0."""
    names = feature.names
    for first in range(len(names) - 3):
        if names[first : first + 4] == QUATERNION:
            quats = values[:, first : first + 4]
            signs = np.where((quats[1:] * quats[:-1]).sum(axis=1) < 0, -1.0, 1.0)
            quats *= np.cumprod([1.0 if quats[0, 3] >= 0 else -1.0, *signs])[:, None]
