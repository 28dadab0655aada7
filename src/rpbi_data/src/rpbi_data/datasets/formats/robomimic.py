"""Data sets of robomimic: one HDF5 file."""

from __future__ import annotations

import errno
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from PIL import Image
from pydantic import Field

from custom_ros_tools.schema import ConfigModel
from rpbi_data.datasets.format import (
    ACTION,
    Array,
    CameraFeature,
    DatasetError,
    DatasetFormat,
    ExportedEpisode,
    Schema,
    require_room,
)
from rpbi_data.datasets.layouts.robomimic import ACTIONS, FILE, observation_key, scaled
from rpbi_data.datasets.provenance import checksums, frame_checksums

SUCCESS = "success"
"""Label of episodes whose last row has the reward 1, and filter of them in `mask`."""

ROOM_BYTES = 100_000
"""Disk space in addition to that of the numbers of an episode [bytes]."""


class RobomimicConfig(ConfigModel):
    """Options of robomimic data sets."""

    image_height: int = Field(84, ge=1, description="Rows of pixels of images, which are scaled.")
    image_width: int = Field(84, ge=1, description="Columns of pixels.")
    success: str = Field(SUCCESS, description="Label of episodes whose last row has the reward 1.")
    valid: float = Field(0.1, ge=0.0, lt=1.0, description="Share of episodes in the filter `valid`.")


class Robomimic(DatasetFormat):
    """A robomimic data set: one HDF5 file with actions scaled to [-1, 1]."""

    Config = RobomimicConfig

    def open(self, folder: Path, schema: Schema | None) -> None:
        """Begins the data set."""
        assert schema is not None
        if all(each.key != ACTION for each in schema.features):
            raise DatasetError(folder, f"expected a feature '{ACTION}', found none")
        self._folder, self._schema = folder, schema
        self._file = h5py.File(folder / FILE, "w")
        self._data = self._file.create_group("data")
        self._success: list[str] = []
        self._total = 0
        self._room_bytes = ROOM_BYTES
        self._is_closing = False

    def add(self, index: int, episode: ExportedEpisode) -> dict[str, Any]:
        """Writes an episode after it was read completely and its disk space was checked."""
        stamps: dict[str, Array] = {}
        observations: dict[str, Array] = {}
        for camera in self._schema.cameras:
            images, stamps[camera.key] = self._images(camera, episode)
            observations[observation_key(camera.key)] = images
        values = episode.values(stamps)
        observations |= {observation_key(key): each for key, each in values.items() if key != ACTION}
        size = 2 * sum(each.nbytes for each in observations.values())
        require_room(self._folder, size + ROOM_BYTES)  # HDF5 itself crashes when the disk is full
        name = f"demo_{index}"
        demo = self._data.create_group(name)
        try:
            self._fill(demo, episode, values[ACTION], observations)
            self._file.flush()
        except RuntimeError as error:
            raise OSError(errno.EIO, f"{FILE} cannot be written: {' '.join(str(error).split())}") from error
        except BaseException:
            del self._data[name]
            raise
        self._total += len(episode.times)
        if episode.label == self.config.success:
            self._success.append(name)
        columns = {
            each.key: {"names": list(each.names), "checksums": checksums(values[each.key])}
            for each in self._schema.features
            if each.key != ACTION  # which is scaled by the values of all episodes
        }
        crcs = {key: frame_checksums(observations[observation_key(key)]) for key in stamps}
        count = len(episode.times)
        return {"frames": count, "fps": self._schema.fps, "columns": columns, "frame_checksums": crcs}

    def take_back(self, index: int) -> None:
        """Removes the episode that was added last; its space in the file is reused."""
        if self._is_closing:
            super().take_back(index)
        name = f"demo_{index}"
        self._total -= int(self._data[name].attrs["num_samples"])
        self._success = [each for each in self._success if each != name]
        del self._data[name]
        self._room_bytes = 0

    def close(self) -> None:
        """Scales all actions, and writes the facts on the whole data set."""
        if self._room_bytes:
            require_room(self._folder, self._room_bytes)  # see `add`
        self._is_closing = True
        demos = list(self._data.values())
        low = np.min([demo[ACTIONS][:].min(axis=0) for demo in demos], axis=0)
        high = np.max([demo[ACTIONS][:].max(axis=0) for demo in demos], axis=0)
        for demo in demos:
            demo[ACTIONS][...] = scaled(demo[ACTIONS][:], low, high)
        scaling = self._file.create_group("action_scaling")
        scaling["low"], scaling["high"] = low, high
        scaling.attrs["names"] = json.dumps(next(each.names for each in self._schema.features if each.key == ACTION))
        scaling.attrs["formula"] = "low + (actions + 1) / 2 * (high - low)"
        self._data.attrs["total"] = self._total
        self._data.attrs["env_args"] = json.dumps(
            {"env_name": "ros_pybullet_interface", "type": 2, "env_kwargs": {"fps": self._schema.fps}}
        )
        names = {observation_key(each.key): list(each.names) for each in self._schema.features if each.key != ACTION}
        self._data.attrs["observation_names"] = json.dumps(names)
        self._write_split(list(self._data))
        if self._success:
            self._file["mask/success"] = np.array(self._success, dtype="S")
        self._file.close()

    def _fill(
        self, demo: h5py.Group, episode: ExportedEpisode, actions: Array, observations: Mapping[str, Array]
    ) -> None:
        count = len(actions)
        demo[ACTIONS] = actions
        for key, values in observations.items():
            _put_observation(demo, key, values)
        last = np.arange(count) == count - 1
        demo["rewards"] = (last & (episode.label == self.config.success)).astype(np.float32)
        demo["dones"] = last.astype(np.int64)
        demo.attrs["num_samples"] = count
        demo.attrs["task"], demo.attrs["label"] = episode.task, episode.label

    def _write_split(self, names: list[str]) -> None:
        """Writes the filters `train` and `valid`, a random but reproducible split of the episodes."""
        count = max(1, round(self.config.valid * len(names))) if self.config.valid and len(names) > 1 else 0
        chosen = {names[i] for i in np.random.default_rng(0).permutation(len(names))[:count]}
        for name, of_filter in (("train", sorted({*names} - chosen)), ("valid", sorted(chosen))):
            if of_filter:
                self._file[f"mask/{name}"] = np.array(of_filter, dtype="S")

    def _images(self, camera: CameraFeature, episode: ExportedEpisode) -> tuple[Array, Array]:
        size = (self.config.image_width, self.config.image_height)
        images, stamps = [], []
        for pixels, stamp in episode.frames(camera.key):
            images.append(np.asarray(Image.fromarray(pixels).resize(size, Image.Resampling.BILINEAR)))
            stamps.append(stamp)
        return np.array(images), np.array(stamps)

    @classmethod
    def recognises(cls, folder: Path) -> bool:
        """Returns whether there is an HDF5 file, even a broken one."""
        return bool(list(folder.glob("*.hdf5")))

    @classmethod
    def faults(cls, folder: Path) -> Iterator[str]:
        """Yields a sentence for each fault."""
        from rpbi_data.datasets.checks.robomimic import robomimic_faults

        return robomimic_faults(folder)

    @classmethod
    def summary(cls, folder: Path) -> str:
        """Returns episodes and rows of each file."""
        found = []
        for path in sorted(folder.glob("*.hdf5")):
            with h5py.File(path) as file:
                data = file["data"]
                found.append(f"robomimic {path.name}: {len(data)} episodes, {data.attrs['total']} frames")
        return "; ".join(found)


def _put_observation(demo: h5py.Group, key: str, values: Array) -> None:
    options: Mapping[str, Any] = {"compression": "gzip", "chunks": (1, *values.shape[1:])} if values.ndim > 2 else {}
    demo.create_dataset(f"obs/{key}", data=values, **options)
    demo.create_dataset(f"next_obs/{key}", data=np.concatenate([values[1:], values[-1:]]), **options)
