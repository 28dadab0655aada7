"""The job of a farm, which determines its episodes, and the outcome of each."""

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
"""File of a folder of episodes with all that policies print."""
_CHANGED = {"world_sha256": "the world, or a file that it names", "policy_sha256": "the file of the policy"}


@dataclass(frozen=True)
class FarmJob:
    """All inputs on which the episodes of a farm depend.

    Attributes:
        world: The main YAML file.
        policy: `module:Class` of the policy.
        seed: Seed of the farm; that of episode n is (seed, n).
        ticks: Length of an episode that its policy does not end.
        world_sha256: SHA-256 of the description of the world, see `World.describe`.
        policy_sha256: SHA-256 of the file of the policy.
        images: Whether the colour images of cameras are recorded.
        python_path: Folders in which the policy is looked for, too.
        facts: Further attributes of each `Episode`.
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
        """Writes the job into a folder, or compares it with the existing one.

        Raises:
            EpisodeError: If the folder has episodes of another job; the message names the differences.
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
        """Returns sentences on the differences; of files whose names differ, the contents are not compared."""
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
        number: Its number; -1 if it concerns none.
        label: Its label, if it is there.
        fault: Reason why it was not made.
        is_lost: Whether its process has ended meanwhile, so that it is worth another try.
        stops: Whether no other episode can be made, either.
    """

    number: int
    label: str = ""
    fault: str = ""
    is_lost: bool = False
    stops: bool = False


def digest(text: str) -> str:
    """Returns the SHA-256 of a text."""
    return hashlib.sha256(text.encode()).hexdigest()


def policy_digest(policy: type[Policy]) -> str:
    """Returns the SHA-256 of the file of a policy; empty without a file."""
    file = inspect.getsourcefile(policy)
    return hashlib.sha256(read_file(file)).hexdigest() if file else ""


def _read(path: Path) -> dict[str, Any]:
    try:
        return load_foreign_yaml(path.parent, path.name)
    except ConfigError as error:
        raise EpisodeError(path, f"cannot be read: {printable(error.problems[0].message)}") from error
