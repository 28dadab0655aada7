"""The task of a Ray cluster: makes an episode on one of its nodes."""

from __future__ import annotations

import shutil
import socket
import tempfile
from functools import lru_cache

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.foreign import path_below
from rpbi_data.episodes.folder import BAG, FACTS, EpisodeFolder
from rpbi_data.farm.job import EpisodeOutcome, FarmJob

from .maker import EpisodeMaker

Files = dict[str, bytes]
"""Contents of the files of an episode by name."""


def make_remotely(job: FarmJob, number: int) -> tuple[EpisodeOutcome, Files]:
    """Makes an episode in a temporary folder of this node, and returns its files; none if it has failed.

    A fault that stops the farm names the node.
    """
    node = socket.gethostname()
    try:
        maker = _maker(job)
    except InterfaceError as error:
        return EpisodeOutcome(number, fault=f"{node}: {error}", stops=True), {}
    with tempfile.TemporaryDirectory(prefix="rpbi-farm-") as path:
        folder = EpisodeFolder(path)
        outcome = maker.make(folder, number)
        place = folder.folder_of(number)
        files = {name: (place / name).read_bytes() for name in (BAG, FACTS)} if outcome.label else {}
    return (outcome._replace(fault=f"{node}: {outcome.fault}") if outcome.stops else outcome), files


def store(folder: EpisodeFolder, number: int, files: Files) -> None:
    """Puts an episode of another node into a folder, under its final name when it is complete.

    Raises:
        OSError: If it cannot be written.
    """
    part = folder.part_of(number)
    shutil.rmtree(part, ignore_errors=True)
    part.mkdir()
    for name, content in files.items():
        path_below(part, name).write_bytes(content)
    part.rename(folder.folder_of(number))


@lru_cache(maxsize=1)
def _maker(job: FarmJob) -> EpisodeMaker:
    """Returns the maker of a job, cached, since the process of a node mostly continues with the same job."""
    return EpisodeMaker(job)
