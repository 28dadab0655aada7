"""Defines `FarmJob`, which determines the content of a farm's episodes, and `EpisodeOutcome`."""

from __future__ import annotations

import hashlib
import inspect
import os
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from custom_ros_tools.config import read_file
from custom_ros_tools.errors import ConfigError
from custom_ros_tools.files import atomic_file
from custom_ros_tools.foreign import load_foreign_yaml, printable
from rpbi_data.episodes.errors import EpisodeError
from rpbi_data.episodes.folder import FARM

from .policy import Policy

LOG = "farm.log"
"""File in a folder of episodes that contains the output of the processes that make episodes."""
_CHANGED = {"world_sha256": "the world, or a file that it names", "policy_sha256": "the file of the policy"}


@dataclass(frozen=True)
class FarmJob:
    """World, policy, seed and options, which together determine the episodes of a farm.

    Attributes:
        world: The main YAML file.
        policy: `module:Class` of the policy.
        seed: Seed of the farm; the seed of episode n is `(seed, n)`.
        ticks: Number of ticks after which an episode ends if its policy has not ended it.
        world_sha256: SHA-256 of the text that `World.describe` returns.
        policy_sha256: SHA-256 of the file that defines the policy; empty if the policy has no file.
        images: Whether the colour images of cameras are recorded.
        python_path: Additional folders in which the module of the policy is searched for.
        facts: Further attributes of each `Episode`, such as versions; ignored when jobs are compared.
    """

    world: str
    policy: str
    seed: int
    ticks: int
    world_sha256: str
    policy_sha256: str
    images: bool = False
    python_path: tuple[str, ...] = ()
    facts: Mapping[str, Any] = field(default_factory=dict, compare=False)

    def claim(self, folder: Path) -> None:
        """Writes this job into a folder. If the folder already contains a job, checks that it equals this job.

        Raises:
            EpisodeError: If the folder contains a different or unreadable job, or contains files but no job.
            OSError: If the job cannot be written.
        """
        path, own = folder / FARM, self._identity()
        if os.path.lexists(path):
            if changes := list(self._changes(_read(path))):
                raise EpisodeError(path, f"{'; '.join(changes)}: name another folder by --out")
            return
        if folder.is_dir() and (others := sorted(each.name for each in folder.iterdir() if each.name[0] != ".")):
            names = ", ".join(others[:5])
            raise EpisodeError(folder, f"expected an empty folder or one of a farm, it has {names}: name another one")
        folder.mkdir(parents=True, exist_ok=True)
        with atomic_file(path) as part:
            part.write_text(yaml.safe_dump(own, sort_keys=False), encoding="utf-8")

    def _identity(self) -> dict[str, Any]:
        keys = [each.name for each in fields(self) if each.name not in ("python_path", "facts")]
        return {key: getattr(self, key) for key in keys}

    def _changes(self, there: Mapping[str, Any]) -> list[str]:
        """Returns messages about the differences between this job and the stored job `there`.

        Changed contents of files are only reported if nothing else differs.
        """
        own, defaults = self._identity(), {each.name: each.default for each in fields(self)}
        changed = [key for key in own if there.get(key, defaults[key]) != own[key]]
        values = [
            f"{key}: {printable(str(there.get(key)), 200)} there, {own[key]} asked for"
            for key in changed
            if key not in _CHANGED
        ]
        contents = [f"{text} has changed" for key, text in _CHANGED.items() if key in changed]
        return values or contents


class EpisodeOutcome(NamedTuple):
    """Outcome of an episode.

    Attributes:
        number: Number of the episode; -1 if the outcome does not concern a particular episode.
        label: Label of the episode; empty if the episode was not made.
        fault: Reason why the episode was not made; empty if it was made.
        is_lost: Whether the process that made the episode ended before completing it, so that a retry is worthwhile.
        stops: Whether the fault prevents all further episodes, too.
    """

    number: int
    label: str = ""
    fault: str = ""
    is_lost: bool = False
    stops: bool = False


def digest(text: str) -> str:
    """Returns the SHA-256 of a text encoded in UTF-8, in hexadecimal digits."""
    return hashlib.sha256(text.encode()).hexdigest()


def policy_digest(policy: type[Policy]) -> str:
    """Returns the SHA-256 of the file that defines a policy, or an empty string if the policy has no file."""
    file = inspect.getsourcefile(policy)
    return hashlib.sha256(read_file(file)).hexdigest() if file else ""


def _read(path: Path) -> dict[str, Any]:
    try:
        return load_foreign_yaml(path.parent, path.name)
    except ConfigError as error:
        raise EpisodeError(path, f"cannot be read: {printable(error.problems[0].message)}") from error
