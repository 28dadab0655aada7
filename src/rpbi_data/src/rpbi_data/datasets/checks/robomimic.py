"""Checks of data sets of robomimic."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from rpbi_data.datasets.foreign_files import hdf5_faults
from rpbi_data.datasets.format import ACTION
from rpbi_data.datasets.layouts.robomimic import ACTIONS, observation_key
from rpbi_data.datasets.provenance import frame_changes, frame_checksums

from .values import Facts, feature_faults, guarded, number_faults

MAX_SCALING_ERROR = 1e-6
"""Largest deviation of the largest or least scaled action from 1 or -1."""


def robomimic_faults(folder: Path) -> Iterator[str]:
    """Yields a sentence for each fault of a robomimic data set."""
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
    except (KeyError, ValueError):  # of another tool
        return {}


def _demo_faults(
    demo: h5py.Group, stored: Mapping[str, Any], shapes: dict[str, tuple[int, ...]], names: Mapping[str, list[str]]
) -> Iterator[str]:
    """Checks an episode.

    Args:
        demo: Its group.
        stored: Its facts; empty for none.
        shapes: Shapes of rows in the episodes before, to which those of this one are added.
        names: Names of the numbers of observations.
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
