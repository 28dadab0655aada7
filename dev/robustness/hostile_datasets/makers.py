"""Good data sets of each format, and a hostile one for each seed."""

from __future__ import annotations

import contextlib
import io
import random
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from written_episodes import write_episode

from custom_ros_tools.console.modules import command_of
from rpbi_data.episodes.folder import EpisodeFolder

from . import lerobot, robomimic, rosbag2

MAKERS = {"lerobot": lerobot.MAKERS, "robomimic": robomimic.MAKERS, "mcap": rosbag2.MAKERS}
"""Changes by format and name."""


class HostileDataset(NamedTuple):
    """A hostile data set.

    Attributes:
        seed: By which it was made.
        how: What was done.
        path: Its folder, in a folder of its own; code in it makes `canary` in the same folder.
    """

    seed: int
    how: str
    path: Path


def good_datasets(folder: Path) -> dict[str, Path]:
    """Exports two short episodes in each format."""
    episodes = EpisodeFolder(folder / "demos")
    for phase in (0.0, 0.4):
        write_episode(episodes, seconds=0.4, phase=phase)
    command, found = command_of("rpbi_data.console.export"), {}
    assert command is not None
    for name in MAKERS:
        found[name] = folder / name
        with contextlib.redirect_stdout(io.StringIO()) as said:
            code = command.run([str(episodes.path), "--to", name, "--out", str(found[name])])
        assert code == 0, said.getvalue()
    return found


def hostile_datasets(name: str, good: Path, seeds: range, folder: Path) -> Iterator[HostileDataset]:
    """Yields a hostile data set of a format for each seed; all kinds come equally often."""
    for seed in seeds:
        path = folder / f"{name}{seed}" / "dataset"
        shutil.copytree(good, path)
        how = list(MAKERS[name])[seed % len(MAKERS[name])]
        MAKERS[name][how](path, random.Random(f"{name} {seed}"))
        yield HostileDataset(seed, how, path)
