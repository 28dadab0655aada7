"""The layout of a folder of episodes, and the description that is stored with each episode."""

from __future__ import annotations

import fcntl
import os
import platform
import re
import shutil
import stat
import subprocess
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from custom_ros_tools.config import SOURCES, ros_packages
from custom_ros_tools.errors import ConfigError
from custom_ros_tools.files import atomic_file
from custom_ros_tools.foreign import entries_of, path_below, printable, read_below

from .errors import EpisodeError
from .facts import MAX_BYTES, MAX_LABEL, MAX_NOTE, MAX_NUMBER, checked_label, facts_in

BAG, FACTS, EARLIER = "episode.bag", "episode.yaml", "earlier_commands.bag"
"""Files of an episode: bag, description, and commands that were sent too early for the recorder to receive."""
FARM = "farm.yaml"
"""File in a folder of episodes that contains the job of the farm that makes the episodes."""
FILES, DISCARDED = "files", "discarded"
SET_BACK = "set_back_s"
STAMPED = ("joint_states", "base_state", "contacts", "ft_sensor")
"""Last parts of the names of topics whose stamps are in the world's time."""
SEAL = "sha256"
"""Key of the SHA-256 of a topic's messages, in `Episode.topics`."""
UNREADABLE = "cannot be read"
"""State of an episode whose description cannot be read."""
_POLL_S = 0.05
_COMPLETE = re.compile(r"episode_([0-9]{6}|[1-9][0-9]{6,11})")
_PARTIAL = re.compile(r"\.episode_([0-9]{6}|[1-9][0-9]{6,11})\.part")


@dataclass
class Episode:
    """Description of an episode, which is stored in the file `episode.yaml`.

    Attributes:
        number: Number of the episode in its folder.
        state: `recording`, `complete`, `incomplete` (ended early or not recovered, see `note`), `recovered` (repaired
            after the recorder was killed), or `UNREADABLE`.
        label: The user's label for the outcome, such as `success`.
        note: Reason for a state other than `complete`, and further messages for the user.
        started: Wall time of the start, ISO 8601.
        seconds: Duration in wall time, or in the world's time if a farm made the episode [s].
        namespace: Namespace of the simulator.
        seeds: Text about random seeds, from the recorder's parameter `seeds` or from the farm.
        versions: Versions of this workspace, PyBullet, Python and numpy, indexed by name.
        git: Commit of the workspace, followed by ` changed` if files differ from the commit; empty if unknown.
        files: Files named in the world's description, see `rpbi_data.episodes.files`.
        published: Number of messages that publishers sent to the recorder, indexed by topic.
        topics: Properties of the topics in the bag, indexed by topic; see `rpbi_data.episodes.bags.measure_topics`.
    """

    number: int
    state: str = "recording"
    label: str = ""
    note: str = ""
    started: str = ""
    seconds: float = 0.0
    namespace: str = "/"
    seeds: str = ""
    versions: dict[str, str] = field(default_factory=dict)
    git: str = ""
    files: list[dict[str, Any]] = field(default_factory=list)
    published: dict[str, int] = field(default_factory=dict)
    topics: dict[str, dict[str, Any]] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """Name of the episode's folder."""
        return f"episode_{self.number:06d}"

    @property
    def messages(self) -> int:
        """Number of messages in the bag."""
        return sum(each["messages"] for each in self.topics.values())

    @property
    def lost(self) -> dict[str, int]:
        """Number of messages that were sent to the recorder but are not in the bag, indexed by topic.

        Topics without loss are left out.
        """
        recorded = {topic: each["messages"] for topic, each in self.topics.items()}
        lost = {topic: sent - recorded.get(topic, 0) for topic, sent in self.published.items()}
        return {topic: count for topic, count in lost.items() if count > 0}

    @property
    def set_back_s(self) -> float:
        """Largest time by which the clock of a topic was set back [s]; 0 if no clock was set back."""
        return max((float(each.get(SET_BACK, 0.0)) for each in self.topics.values()), default=0.0)

    @property
    def simulated_s(self) -> float | None:
        """Simulated duration from the stamps of topics in `STAMPED` [s]; None if the topics' rates are unknown."""
        spans = [
            (each["messages"] - 1) / each["rate_hz"]
            for topic, each in self.topics.items()
            if topic.rpartition("/")[2] in STAMPED and each["rate_hz"] > 0.0
        ]
        return max(spans, default=None)

    def joint_rhythm(self) -> tuple[float, float] | None:
        """Returns the lowest mean rate [Hz] and the longest gap [s] of joint state topics; None without such topics."""
        found = [each for topic, each in self.topics.items() if topic.endswith("/joint_states")]
        if not found:
            return None
        return min(each["rate_hz"] for each in found), max(each["max_gap_s"] for each in found)


class EpisodeFolder:
    """A folder of episodes.

    The folder contains a folder for each episode, `episode_000000/` and so on, `files/` with the worlds' files, and
    `discarded/`. While an episode is being recorded, its folder is `.episode_000000.part`, which is renamed when the
    episode is complete.

    Args:
        path: Path of the folder, which need not exist.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)

    @property
    def files(self) -> Path:
        """Folder with copies of the worlds' files, which all episodes share."""
        return self.path / FILES

    def numbers(self) -> list[int]:
        """Returns the numbers of all finished episodes, ascending.

        Raises:
            EpisodeError: If the folder does not exist.
        """
        if not self.path.is_dir():
            raise EpisodeError(self.path, "expected a folder of episodes, there is none")
        return sorted(_numbers(self.path, _COMPLETE))

    def taken(self) -> set[int]:
        """Returns the numbers of all finished episodes, including discarded ones."""
        return {*_numbers(self.path, _COMPLETE), *_numbers(self.path / DISCARDED, _COMPLETE)}

    def all(self) -> Iterator[Episode]:
        """Yields all finished episodes. An episode without a readable description has the state `UNREADABLE`."""
        for number in self.numbers():
            try:
                yield read_facts(self.folder_of(number))
            except EpisodeError as error:
                yield Episode(number, UNREADABLE, note=error.message.removeprefix(f"{UNREADABLE}: "))

    def read(self, number: int) -> Episode:
        """Reads the description of a finished episode.

        Raises:
            EpisodeError: If the episode does not exist, or its description cannot be read.
        """
        if number not in self.numbers():
            known = printable(", ".join(map(str, self.numbers())), MAX_LABEL) or "none"
            raise EpisodeError(self.path, f"no episode {number}; there are {known}")
        return read_facts(self.folder_of(number))

    def folder_of(self, number: int) -> Path:
        """Returns the folder of a finished episode."""
        return self.path / f"episode_{number:06d}"

    def part_of(self, number: int) -> Path:
        """Returns the temporary folder of an episode."""
        return self.path / f".episode_{number:06d}.part"

    def begin(self, number: int | None = None, **facts: Any) -> tuple[Episode, Path]:
        """Creates the temporary folder of a new episode.

        Args:
            number: Number of the episode; by default, the next number after all used and discarded numbers.
            facts: Further attributes of the episode.

        Returns:
            The episode and its temporary folder.

        Raises:
            EpisodeError: If the number is in use, or is too large.
            OSError: If the description cannot be written. The temporary folder is then removed.
        """
        self.path.mkdir(parents=True, exist_ok=True)
        while True:
            used = self.taken() | set(_numbers(self.path, _PARTIAL))
            chosen = max(used, default=-1) + 1 if number is None else number
            if number in used or chosen > MAX_NUMBER:
                raise EpisodeError(self.path, f"expected a number that is not used, got {chosen}")
            try:
                self.part_of(chosen).mkdir()
                break
            except FileExistsError:  # another process has just created the folder
                continue
        episode, part = Episode(chosen, **facts), self.part_of(chosen)
        try:
            write_facts(part, episode)
        except OSError:
            shutil.rmtree(part, ignore_errors=True)
            raise
        return episode, part

    def complete(self, part: Path, episode: Episode) -> Path:
        """Writes an episode's description, renames its temporary folder to the final name, and returns the path."""
        write_facts(part, episode)
        return part.rename(self.folder_of(episode.number))

    def partial(self) -> list[Path]:
        """Returns the temporary folders of episodes that are being recorded or whose recorder was killed."""
        return sorted(map(self.part_of, _numbers(self.path, _PARTIAL)))

    def discard(self, number: int) -> Path:
        """Moves an episode into the folder `discarded`, and returns the new path.

        Raises:
            EpisodeError: If the episode does not exist.
            ConfigError: If `discarded` is a symbolic link.
        """
        self.read(number)
        target = path_below(self.path, f"{DISCARDED}/{self.folder_of(number).name}")
        target.parent.mkdir(exist_ok=True)
        return self.folder_of(number).rename(target)

    def relabel(self, number: int, label: str) -> Episode:
        """Changes the label of an episode, and returns the changed `Episode`.

        Raises:
            EpisodeError: If the episode does not exist.
            InterfaceError: If the label is too long, or has control characters.
        """
        episode = self.read(number)
        episode.label = checked_label(label)
        write_facts(self.folder_of(number), episode)
        return episode

    def free_mb(self) -> float:
        """Returns the free space of the disk that contains the folder, or will contain it [MB]."""
        folder = next(each for each in (self.path.absolute(), *self.path.absolute().parents) if each.is_dir())
        return shutil.disk_usage(folder).free / 1e6


def read_facts(folder: Path) -> Episode:
    """Reads the description of an episode from its folder; the number is taken from the folder's name.

    Raises:
        EpisodeError: If the description cannot be read.
    """
    path = folder / FACTS
    try:
        text = read_below(folder.parent, f"{folder.name}/{FACTS}", MAX_BYTES).decode()
        facts = facts_in(text, str(path))
    except (ConfigError, UnicodeDecodeError) as error:
        problems = error.problems if isinstance(error, ConfigError) else (error,)
        words = "; ".join(str(each).removeprefix(f"{path}: ") for each in problems[:3])
        raise EpisodeError(path, f"{UNREADABLE}: {printable(words)}") from error
    match = _COMPLETE.fullmatch(folder.name) or _PARTIAL.fullmatch(folder.name)
    return Episode(**facts | ({"number": int(match[1])} if match else {}))


def read_part(part: Path) -> Episode:
    """Reads the description of an episode from its temporary folder.

    If the description cannot be read, the result has only the number, the state `UNREADABLE` and a note.
    """
    try:
        return read_facts(part)
    except EpisodeError as error:
        match = _PARTIAL.fullmatch(part.name)
        assert match is not None
        return Episode(int(match[1]), UNREADABLE, note=str(error))


def write_facts(folder: Path, episode: Episode) -> None:
    """Writes the description of an episode into a folder. An existing description is replaced atomically."""
    episode.note = printable(episode.note, MAX_NOTE)
    with atomic_file(folder / FACTS) as part:
        part.write_text(yaml.safe_dump(asdict(episode), sort_keys=False, allow_unicode=True), encoding="utf-8")


def file_in(place: Path, name: str) -> Path | None:
    """Returns the path of an episode's file; None if the file does not exist.

    Args:
        place: Folder of the episode.
        name: Name of the file.

    Raises:
        EpisodeError: If the file is a link, a pipe, a device or a folder.
    """
    try:
        path = path_below(place.parent, f"{place.name}/{name}")
        status = path.lstat()
    except FileNotFoundError:
        return None
    except ConfigError as error:
        raise EpisodeError(place / name, error.problems[0].message) from None
    except OSError as error:
        raise EpisodeError(place / name, error.strerror or str(error)) from None
    if not stat.S_ISREG(status.st_mode):
        raise EpisodeError(path, "expected an ordinary file")
    return path


def hold(part: Path, wait_s: float = 0.0) -> int:
    """Locks the temporary folder of an episode, so that other processes do not repair the episode.

    Args:
        part: The temporary folder.
        wait_s: Longest time to wait until another process releases the lock [s].

    Returns:
        A file descriptor. The lock ends when this process and all child processes that inherited it have closed it.

    Raises:
        BlockingIOError: If another process holds the lock.
        OSError: If `part` is not a folder, or is a symbolic link.
    """
    handle, deadline = os.open(part, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW), time.monotonic() + wait_s
    while True:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return handle
        except OSError as error:
            if not isinstance(error, BlockingIOError) or time.monotonic() > deadline:
                os.close(handle)
                raise
            time.sleep(_POLL_S)


def is_held(part: Path) -> bool:
    """Returns whether a process holds the lock of a temporary folder, usually because it records the episode."""
    try:
        os.close(hold(part))
    except BlockingIOError:
        return True
    except OSError:  # the episode has been completed meanwhile
        pass
    return False


def _numbers(folder: Path, pattern: re.Pattern[str]) -> list[int]:
    if not folder.is_dir():
        return []
    return [int(match[1]) for each in entries_of(folder, links=True) if (match := pattern.fullmatch(each.name))]


def versions() -> dict[str, str]:
    """Returns the versions of this workspace, PyBullet, Python and numpy."""
    return {
        "workspace": ros_packages().get_manifest("rpbi_data").version,
        "pybullet": version("pybullet"),
        "python": platform.python_version(),
        "numpy": np.__version__,
    }


def git_state(folder: Path | None = SOURCES) -> str:
    """Returns the commit of a folder, by default of this workspace; empty if there is none, as for an installed one.

    ` changed` is appended if files differ from the commit.
    """
    if folder is None:
        return ""

    def git(*words: str) -> str:
        done = subprocess.run(["git", "-C", str(folder), *words], capture_output=True, text=True, timeout=20.0)
        return done.stdout.strip() if done.returncode == 0 else ""

    try:
        commit = git("rev-parse", "HEAD")
        return f"{commit} changed" if commit and git("status", "--porcelain", "--untracked-files=no") else commit
    except (OSError, subprocess.TimeoutExpired):
        return ""
