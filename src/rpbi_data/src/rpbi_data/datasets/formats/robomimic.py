"""Data set format robomimic, which consists of one HDF5 file."""

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
from rpbi_data.datasets.checks import Facts, feature_faults, guarded, number_faults
from rpbi_data.datasets.foreign_files import hdf5_faults
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
from rpbi_data.datasets.provenance import checksums, frame_changes, frame_checksums

FILE = "dataset.hdf5"
_OBSERVATION = "observation."
ACTIONS = "actions"
"""Name of an episode's actions in the HDF5 file."""
SUCCESS = "success"
"""Default label of episodes whose last row has the reward 1."""

ROOM_BYTES = 100_000
"""Disk space that is reserved in addition to the size of an episode's values [bytes]."""
MAX_SCALING_ERROR = 1e-6
"""Largest deviation of a column's largest absolute scaled action from 1."""


class RobomimicConfig(ConfigModel):
    """Options of robomimic data sets."""

    image_height: int = Field(84, ge=1, description="Height to which images are scaled [px].")
    image_width: int = Field(84, ge=1, description="Width to which images are scaled [px].")
    success: str = Field(SUCCESS, description="Label of successful episodes; their last row has the reward 1.")
    valid: float = Field(0.1, ge=0.0, lt=1.0, description="Fraction of the episodes that belong to the filter `valid`.")


class Robomimic(DatasetFormat):
    """Format robomimic: one HDF5 file with actions scaled to [-1, 1]."""

    Config = RobomimicConfig
    content = "an HDF5 file (robomimic)"

    def open(self, folder: Path, schema: Schema | None) -> None:
        """Creates the HDF5 file."""
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
        """Reads an episode completely, checks the free disk space, and then writes the episode."""
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
            if each.key != ACTION  # actions are scaled later, with all episodes
        }
        crcs = {key: frame_checksums(observations[observation_key(key)]) for key in stamps}
        count = len(episode.times)
        return {"frames": count, "fps": self._schema.fps, "columns": columns, "frame_checksums": crcs}

    def take_back(self, index: int) -> None:
        """Removes the episode that was added last; raises an OSError if `close` has begun to scale actions."""
        if self._is_closing:
            super().take_back(index)
        name = f"demo_{index}"
        self._total -= int(self._data[name].attrs["num_samples"])
        self._success = [each for each in self._success if each != name]
        del self._data[name]
        self._room_bytes = 0

    def close(self) -> None:
        """Scales all actions, and writes the metadata of the whole data set."""
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
        """Splits the episodes randomly but reproducibly, and writes the filters `train` and `valid`."""
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
        """Returns whether a folder contains an HDF5 file, which may be damaged."""
        return bool(list(folder.glob("*.hdf5")))

    @classmethod
    def faults(cls, folder: Path) -> Iterator[str]:
        """Yields a message for each fault."""
        return _faults(folder)

    @classmethod
    def summary(cls, folder: Path) -> str:
        """Returns a text with the numbers of episodes and rows in each file."""
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


def observation_key(key: str) -> str:
    """Converts the key of a feature to its name in the HDF5 groups `obs` and `next_obs`."""
    return key.removeprefix(_OBSERVATION).replace(".", "_")


def scaled(actions: Array, low: Array, high: Array) -> Array:
    """Scales actions to [-1, 1], and returns the result. Columns whose values are all equal become 0.

    Args:
        actions: Actions, shape (n, columns).
        low: Smallest action of each column over all episodes, shape (columns,).
        high: Largest action of each column over all episodes, shape (columns,).
    """
    extent = np.where(high > low, high - low, 1.0)
    return np.asarray(np.where(high > low, np.clip(2.0 * (actions - low) / extent - 1.0, -1.0, 1.0), 0.0))


def _faults(folder: Path) -> Iterator[str]:
    """Yields a message for each fault of a robomimic data set."""
    facts = Facts(folder)
    episodes = 0
    for path in sorted(folder.glob("*.hdf5")):
        try:
            with h5py.File(path, "r") as file:
                foreign = list(hdf5_faults(file, path.stat().st_size))
                for fault in foreign or guarded("data", _file_faults(file, facts)):
                    yield f"{path.name}: {fault}"
                episodes += len(file.get("data", ()))
        except (OSError, RuntimeError, KeyError) as error:  # h5py has errors of all kinds for a broken file
            yield f"{path.name}: cannot be read: {' '.join(str(error).split())}"
    yield from guarded("rpbi/export.json", facts.total_faults(episodes))
    yield from facts.faults


def _file_faults(file: h5py.File, facts: Facts) -> Iterator[str]:
    data = file.get("data")
    if not isinstance(data, h5py.Group):
        yield "expected a group 'data', found none"
        return
    yield from _environment_faults(data)
    names = sorted(data, key=lambda name: (len(name), name))
    if names != [f"demo_{index}" for index in range(len(names))]:
        yield f"expected episodes demo_0 to demo_{len(names) - 1}, found {', '.join(names[:20])}"
    total = sum(int(data[name].attrs.get("num_samples", 0)) for name in names)
    if int(data.attrs.get("total", -1)) != total:
        yield f"total: {data.attrs.get('total')}, but num_samples of the episodes sum up to {total}"
    shapes: dict[str, tuple[int, ...]] = {}
    for name in names:
        stored = facts.episode(int(name[5:])) if name[5:].isdecimal() else {}
        yield from (f"{name}: {fault}" for fault in _demo_faults(data[name], stored, shapes, _names(data)))
        if name[5:].isdecimal():
            yield from facts.chain_faults(int(name[5:]), stored)
    yield from _mask_faults(file, names)
    yield from _scaling_faults(file, names)


def _environment_faults(data: h5py.Group) -> Iterator[str]:
    try:
        found = json.loads(data.attrs["env_args"])
        if not {"env_name", "type", "env_kwargs"} <= found.keys():
            raise ValueError("env_name, type or env_kwargs is missing")
    except (KeyError, ValueError, AttributeError) as error:
        yield f"env_args: cannot be read: {error}"


def _names(data: h5py.Group) -> dict[str, list[str]]:
    try:
        return dict(json.loads(data.attrs["observation_names"]))
    except (KeyError, ValueError):  # the data set of another tool
        return {}


def _demo_faults(
    demo: h5py.Group, stored: Mapping[str, Any], shapes: dict[str, tuple[int, ...]], names: Mapping[str, list[str]]
) -> Iterator[str]:
    """Yields a message for each fault of an episode.

    Args:
        demo: HDF5 group of the episode.
        stored: Metadata of the episode from the folder `rpbi/`; empty without metadata.
        shapes: Shape of one row in previous episodes, indexed by observation. New observations are added.
        names: Column names of each observation, indexed by observation.
    """
    if ACTIONS not in demo:
        yield f"expected {ACTIONS}, found none"
        return
    actions = demo[ACTIONS][:]
    count = len(actions)
    if int(demo.attrs.get("num_samples", -1)) != count:
        yield f"num_samples: {demo.attrs.get('num_samples')} for {count} actions"
    if stored.get("frames", count) != count:
        yield f"{stored['frames']} frames were exported, found {count}"
    yield from (f"{ACTIONS}: {fault}" for fault in number_faults([str(i) for i in range(actions.shape[1])], actions))
    outside = np.flatnonzero((np.abs(actions) > 1.0).any(axis=1))
    if len(outside):
        yield f"{ACTIONS}: {len(outside)} frames are outside of [-1, 1], first frame {outside[0]}"
    wanted = {observation_key(key): key for key in (*stored.get("columns", {}), *stored.get("frame_checksums", {}))}
    observations = demo.get("obs", {})
    for name in sorted(wanted.keys() - observations.keys()):
        yield f"obs/{name}: was exported and is missing"
    for group in ("obs", "next_obs"):
        for name, values in demo.get(group, {}).items():
            if len(values) != count:
                yield f"{group}/{name}: {len(values)} rows for {count} actions"
            known = shapes.setdefault(f"{group}/{name}", values.shape[1:])
            if known != values.shape[1:]:
                yield f"{group}/{name}: rows of shape {values.shape[1:]}, in other episodes of {known}"
    for name, values in observations.items():
        key = wanted.get(name, "")
        if values.ndim == 2:
            columns = names.get(name) or [str(i) for i in range(values.shape[1])]
            faults = feature_faults(key, columns, values[:], stored if key != ACTION else {})
        else:
            checked = stored.get("frame_checksums", {}).get(key)
            faults = iter(()) if checked is None else frame_changes(frame_checksums(values), checked)
        yield from (f"obs/{name}: {fault}" for fault in faults)
        following = demo.get(f"next_obs/{name}")
        if following is not None and len(following) == len(values) == count > 1:
            if values.ndim == 2:
                is_same = np.array_equal(following[:-1], values[1:], equal_nan=True)
            else:  # one image at a time
                is_same = all(np.array_equal(following[row], values[row + 1]) for row in range(count - 1))
            if not is_same:
                yield f"next_obs/{name}: is not obs/{name} one frame later"
    if "dones" in demo and np.flatnonzero(demo["dones"][:]).tolist() != [count - 1]:
        yield "dones: expected 1 in the last frame alone"


def _mask_faults(file: h5py.File, names: list[str]) -> Iterator[str]:
    for mask, values in file.get("mask", {}).items():
        unknown = {each.decode(errors="replace") for each in values[:]} - set(names)
        if unknown:
            yield f"mask/{mask}: no episode {', '.join(sorted(unknown))}"


def _scaling_faults(file: h5py.File, names: list[str]) -> Iterator[str]:
    scaling = file.get("action_scaling")
    if scaling is None:
        return
    low, high = scaling["low"][:], scaling["high"][:]
    actions = [file["data"][name][ACTIONS][:] for name in names if ACTIONS in file["data"][name]]
    if any(each.shape[1] != len(low) for each in actions) or len(low) != len(high):
        yield f"action_scaling: {len(low)} and {len(high)} numbers for actions of {actions[0].shape[1]}"
        return
    if not actions:
        return
    extent = np.where(high > low, 1.0, 0.0)
    for column in range(len(low)):
        most = max(np.abs(each[:, column]).max() for each in actions)
        if not most <= 1.0 or abs(most - extent[column]) > MAX_SCALING_ERROR:
            if most <= 1.0:
                yield f"action_scaling: column {column} reaches {most:.6g}, expected {extent[column]:g}"
            return
