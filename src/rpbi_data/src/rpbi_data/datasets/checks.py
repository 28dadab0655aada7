"""Checks for all data set formats: checks of numbers, of metadata in `rpbi/`, and of the source recordings."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from custom_ros_tools.errors import shortened
from rpbi_data.datasets.format import QUATERNION, STAMP, STAMP_NAMES, DatasetError
from rpbi_data.datasets.provenance import (
    chain_faults,
    changes,
    episode_file,
    file_digest,
    is_exported,
    read_episode,
    read_export,
)
from rpbi_data.episodes.errors import EpisodeError
from rpbi_data.episodes.folder import BAG, EpisodeFolder, file_in

Array = NDArray[Any]

MAX_NORM_ERROR = 1e-3
"""Largest deviation of the norm of a quaternion from 1."""


def number_faults(names: Sequence[str], values: Array) -> Iterator[str]:
    """Yields a message for each column with non-finite numbers, and for each faulty quaternion.

    A quaternion is faulty if its norm is not 1, or if it changes its sign from one row to the next.

    Args:
        names: Names of the columns.
        values: Values of a feature, shape (n, columns).
    """
    is_bad = ~np.isfinite(values.astype(float))
    for name, bad in zip(names, is_bad.T):
        if bad.any():
            yield f"'{name}' is not finite in {bad.sum()} frames, first in frame {int(np.argmax(bad))}"
    for first in range(len(names) - 3):
        if tuple(names[first : first + 4]) == QUATERNION and not is_bad.any():
            yield from _quaternion_faults(values[:, first : first + 4].astype(float))


def _quaternion_faults(quats: Array) -> Iterator[str]:
    errors = np.abs(np.linalg.norm(quats, axis=1) - 1.0)
    if (errors > MAX_NORM_ERROR).any():
        yield f"the quaternion of frame {int(np.argmax(errors > MAX_NORM_ERROR))} is no unit quaternion"
        return
    flips = np.flatnonzero((quats[1:] * quats[:-1]).sum(axis=1) < 0.0)
    if len(flips):
        yield f"the quaternion changes its sign {len(flips)} times, first from frame {flips[0]} to {flips[0] + 1}"


def guarded(part: str, faults: Iterator[str]) -> Iterator[str]:
    """Yields the messages of a check. If the check raises an error, yields a message about the error instead.

    Args:
        part: Name of the checked part of the data set, for the message about an error.
        faults: Messages of the check.
    """
    try:
        yield from faults
    except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError) as error:
        words = " ".join(str(error).split()) or "none"
        yield f"{part}: has another content than expected ({type(error).__name__}: {shortened(words)})"


class Facts:
    """Metadata of a data set from its folder `rpbi/`; empty if another tool wrote the data set.

    Args:
        folder: The data set.

    Attributes:
        export: Description of the data set; empty if `rpbi/export.json` is missing or cannot be read.
        faults: Messages about files that cannot be read.
        is_there: Whether the data set has a folder `rpbi/`.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.export: dict[str, Any] = {}
        self.faults: list[str] = []
        self.is_there = is_exported(folder)
        if self.is_there:
            try:
                self.export = read_export(folder)
            except ValueError as error:
                self.faults.append(str(error))

    def episode(self, index: int) -> dict[str, Any]:
        """Returns the metadata of an episode; empty if the metadata cannot be read.

        If the data set has a folder `rpbi/` and the metadata cannot be read, adds a message to `faults`.
        """
        if not self.is_there:
            return {}
        try:
            return read_episode(self._folder, index)
        except ValueError as error:
            self.faults.append(str(error))
            return {}

    def total_faults(self, episodes: int) -> Iterator[str]:
        """Yields a message if the number of episodes in the data set differs from the number of exported episodes."""
        exported = self.export.get("episodes")
        if exported is not None and len(exported) != episodes:
            yield f"rpbi/export.json: {len(exported)} episodes were exported, found {episodes}"

    def chain_faults(self, index: int, facts: Mapping[str, Any]) -> Iterator[str]:
        """Yields a message if an episode's chain of state hashes is missing or broken.

        Args:
            index: Index of the episode in the data set.
            facts: Metadata of the episode; if empty, the chain is not checked.
        """
        if facts:
            name = f"rpbi/{episode_file(self._folder, index).name}"
            hashes = facts.get("state_hashes")
            if not isinstance(hashes, Mapping) or not isinstance(hashes.get("chain"), list):
                yield f"{name}: there is no chain of state hashes"
                return
            yield from (f"{name}: {fault}" for fault in chain_faults(hashes["chain"], hashes.get("last", "")))


def feature_faults(key: str, names: Sequence[str], values: Array, facts: Mapping[str, Any]) -> Iterator[str]:
    """Yields messages about faulty numbers of a feature in an episode, and about changes since the export.

    Args:
        key: Key of the feature.
        names: Names of the feature's columns in the data set.
        values: Values of the feature in the episode, shape (n, columns).
        facts: Metadata of the episode; if empty, changes since the export are not checked.
    """
    yield from number_faults(names, values)
    stored = facts.get("columns", {}).get(key)
    if stored is None:
        return
    exported = stored["names"]
    if len(exported) != values.shape[1]:
        yield f"expected {len(exported)} numbers a row ({', '.join(exported)}), found {values.shape[1]}"
    elif facts.get("frames") == len(values):
        yield from changes(exported, values, stored["checksums"])
    if key == STAMP and values.shape[1] == len(STAMP_NAMES):
        wrong = np.flatnonzero(np.diff(values @ np.array([1_000_000_000, 1])) <= 0)
        if len(wrong):
            yield f"stamps are not ascending, first at frame {wrong[0] + 1}"


def source_faults(dataset: Path, folder: EpisodeFolder) -> Iterator[str]:
    """Yields a message for each source recording that is missing or was changed since the export.

    Args:
        dataset: The exported data set.
        folder: The episodes from which the data set was exported.

    Raises:
        DatasetError: If the data set was not exported from episodes.
    """
    if not is_exported(dataset):
        raise DatasetError(dataset, "has no rpbi/: it was not exported from episodes")
    try:
        numbers = read_export(dataset).get("episodes", [])
    except ValueError:  # reported by the check of the data set
        return
    for index, number in enumerate(numbers):
        try:
            folder.read(number)
            place = folder.folder_of(number)
            bag = file_in(place, BAG) or place / BAG  # the latter cannot be opened: reported below
            if file_digest(bag) != read_episode(dataset, index)["source"]["bag_sha256"]:
                yield f"{bag}: is not the recording that episode {index} was exported from"
        except (EpisodeError, OSError) as error:
            yield f"episode {index}: its recording cannot be read: {error}"
        except (ValueError, KeyError, TypeError):  # reported by the check of the data set
            continue
