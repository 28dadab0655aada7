"""Metadata that the export stores in a data set's folder `rpbi/`, so that later checks can detect changes.

- `rpbi/export.json` describes the data set.
- `rpbi/episode_000000.json` describes an episode: its source, its chain of state hashes, and checksums of its values.
  The checksums reveal values that were changed, swapped or shifted.
- `rpbi/episode_000000.npz` contains coarse images, with which checks compare the frames of videos.
"""

from __future__ import annotations

import hashlib
import io
import json
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from custom_ros_tools.files import atomic_file

from .foreign_files import read_json

Array = NDArray[Any]

FOLDER, EXPORT = "rpbi", "export.json"
VERSION = 1
"""Version of the file `export.json`."""


def file_digest(path: Path) -> str:
    """Returns the SHA-256 of a file in hexadecimal digits."""
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while block := file.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()


# --- Chains of state hashes


def hash_chain(states: Iterable[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Returns copies of recorded states with an additional key `link`: the SHA-256 of the previous link and the state.

    Args:
        states: States of the simulator in the order of recording, with the keys `stamp` [s], `resets`, `tick`,
            `commands` and `hash`.
    """
    chain: list[dict[str, Any]] = []
    link = ""
    for state in states:
        link = _link(link, state)
        chain.append({**state, "link": link})
    return chain


def chain_faults(chain: Sequence[Mapping[str, Any]], last: str) -> Iterator[str]:
    """Yields a message if a chain of state hashes is broken or incomplete.

    Args:
        chain: States with links, from `hash_chain`.
        last: Last link of the chain, which is stored separately; empty for an empty chain.
    """
    link = ""
    for state in chain:
        link = _link(link, {key: value for key, value in state.items() if key != "link"})
        if link != state.get("link"):
            yield f"the chain of state hashes is broken at tick {state.get('tick')}"
            return
    if link != last:
        yield f"the chain of state hashes is incomplete: it ends with {len(chain)} states"


def _link(before: str, state: Mapping[str, Any]) -> str:
    text = json.dumps([before, *(state.get(key) for key in ("stamp", "resets", "tick", "commands", "hash"))])
    return hashlib.sha256(text.encode()).hexdigest()


# --- Checksums of columns


def checksums(values: Array) -> list[list[int]]:
    """Returns CRC-32 checksums of each column: of all rows, of all rows but the last, and of all rows but the first.

    Args:
        values: Values of a feature, shape (n, columns).
    """
    return [[_crc(column), _crc(column[:-1]), _crc(column[1:])] for column in values.T]


def changes(names: Sequence[str], values: Array, stored: Sequence[Sequence[int]]) -> Iterator[str]:
    """Yields a message for each column whose values do not match its stored checksums.

    Args:
        names: Names of the columns.
        values: Values to check, shape (n, columns), of the same data type as the exported values.
        stored: Checksums that `checksums` returned for the n exported rows.
    """
    by_whole = {whole: name for name, (whole, _, _) in zip(names, stored)}
    for name, column, (whole, without_last, without_first) in zip(names, values.T, stored):
        found = _crc(column)
        if found == whole:
            continue
        if found in by_whole:
            yield f"'{name}' has the values that were exported as '{by_whole[found]}'"
        elif len(column) > 1 and _crc(column[1:]) == without_last:
            yield f"'{name}' is late by one frame"
        elif len(column) > 1 and _crc(column[:-1]) == without_first:
            yield f"'{name}' is early by one frame"
        else:
            yield f"'{name}' was changed after the export"


def frame_checksums(images: Iterable[Array]) -> list[int]:
    """Returns the CRC-32 checksum of each image."""
    return [_crc(np.asarray(pixels)) for pixels in images]


def frame_changes(found: Sequence[int], stored: Sequence[int]) -> Iterator[str]:
    """Yields a message if the checksums of images differ from the stored checksums."""
    if found == stored:
        return
    if len(found) != len(stored):
        yield f"expected {len(stored)} images, found {len(found)}"
    elif found[1:] == stored[:-1]:
        yield "its images are late by one frame"
    elif found[:-1] == stored[1:]:
        yield "its images are early by one frame"
    else:
        first = next(number for number, (one, other) in enumerate(zip(found, stored)) if one != other)
        yield f"the image of frame {first} is another than was exported"


def _crc(column: Array) -> int:
    return zlib.crc32(np.ascontiguousarray(column, column.dtype.newbyteorder("<")).tobytes())


# --- Files


def episode_file(folder: Path, index: int) -> Path:
    """Returns the path of the JSON file with the metadata of an episode.

    Args:
        folder: The data set.
        index: Index of the episode in the data set, from 0.
    """
    return folder / FOLDER / f"episode_{index:06d}.json"


def write_export(folder: Path, facts: Mapping[str, Any]) -> None:
    """Writes the description of a data set to `rpbi/export.json`."""
    _write(folder / FOLDER / EXPORT, {"version": VERSION, **facts})


def write_episode(folder: Path, index: int, facts: Mapping[str, Any], images: Mapping[str, Array]) -> None:
    """Writes the metadata of an episode, and the episode's coarse images, which are indexed by camera."""
    path = episode_file(folder, index)
    _write(path, facts)
    if images:
        data = io.BytesIO()
        np.savez_compressed(data, **images)
        with atomic_file(path.with_suffix(".npz")) as part:
            part.write_bytes(data.getvalue())


def remove_episode(folder: Path, index: int) -> None:
    """Removes the files that `write_episode` wrote for an episode."""
    for suffix in (".json", ".npz"):
        episode_file(folder, index).with_suffix(suffix).unlink(missing_ok=True)


def _write(path: Path, facts: Mapping[str, Any]) -> None:
    path.parent.mkdir(exist_ok=True)
    with atomic_file(path) as part:
        part.write_text(json.dumps(facts, indent=1), encoding="utf-8")


def is_exported(folder: Path) -> bool:
    """Returns whether a data set has a folder `rpbi/`, which means that this project exported the data set."""
    return (folder / FOLDER).is_dir()


def read_export(folder: Path) -> dict[str, Any]:
    """Returns the description of a data set; raises a ValueError if `rpbi/export.json` cannot be read."""
    return _read(folder / FOLDER / EXPORT)


def read_episode(folder: Path, index: int) -> dict[str, Any]:
    """Returns the metadata of an episode; raises a ValueError if the metadata cannot be read."""
    return _read(episode_file(folder, index))


def read_images(folder: Path, index: int) -> dict[str, Array]:
    """Returns the coarse images of an episode, indexed by camera; raises a ValueError if the file cannot be read."""
    path = episode_file(folder, index).with_suffix(".npz")
    try:
        with np.load(path) as data:
            return dict(data)
    except MemoryError:
        raise
    except Exception as error:  # zipfile and numpy have errors of all kinds for a broken file
        raise ValueError(f"{FOLDER}/{path.name} cannot be read: {' '.join(str(error).split())}") from error


def _read(path: Path) -> dict[str, Any]:
    try:
        data = read_json(path.parent.parent, f"{FOLDER}/{path.name}")
    except ValueError as error:
        raise ValueError(f"{FOLDER}/{path.name} cannot be read: {error}") from error
    if not isinstance(data, dict):
        raise ValueError(f"{FOLDER}/{path.name}: expected a mapping")
    return data
