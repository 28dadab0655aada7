"""Makes the episodes of a job, in a child process of the farm or on a node of a Ray cluster.

The child process is started with `python -m rpbi_data.farm.ros.maker FD`. It makes the episodes that are requested over
the connection with the file descriptor FD.
"""

from __future__ import annotations

import logging
import shutil
import signal
import socket
import sys
import tempfile
from datetime import datetime
from functools import lru_cache
from multiprocessing.connection import Connection

import pybullet

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.foreign import path_below
from rpbi.ros.headers import use_own_frames, use_prefix
from rpbi.world import World
from rpbi.world.loading import LoadedWorld, load_world
from rpbi_data.episodes.bags import measure_topics
from rpbi_data.episodes.errors import DISK_FULL
from rpbi_data.episodes.folder import BAG, FACTS, EpisodeFolder
from rpbi_data.farm.job import EpisodeOutcome, FarmJob, digest, policy_digest
from rpbi_data.farm.policy import POLICIES
from rpbi_data.farm.run import EpisodeRun

from .bag import EpisodeBag

_log = logging.getLogger(__name__)


def new_world(loaded: LoadedWorld) -> World:
    """Builds a world without a window, and applies its TF prefix and frame names to this process's messages."""
    world = World(loaded, connection_mode=pybullet.DIRECT)
    use_prefix(loaded.config.tf_prefix)
    use_own_frames(world.frames())
    return world


class EpisodeMaker:
    """Makes episodes of a job, each in a new world.

    Args:
        job: Job that determines the episodes.

    Raises:
        InterfaceError: If the world or the policy cannot be loaded on this machine, or the policy's file differs from
            that file on the machine of the farm.
    """

    def __init__(self, job: FarmJob) -> None:
        sys.path += [each for each in job.python_path if each not in sys.path]
        self._job, self._is_checked = job, False
        self._loaded = load_world(job.world)
        self._policy = POLICIES.configured(job.policy, "--policy")
        if policy_digest(self._policy) != job.policy_sha256:
            raise _AnotherError(f"the file of the policy {job.policy}")

    def make(self, folder: EpisodeFolder, number: int) -> EpisodeOutcome:
        """Makes an episode in a folder, and returns its outcome. No files remain from a failed episode."""
        try:
            return EpisodeOutcome(number, self._make(folder, number))
        except OSError as error:
            is_full = error.errno in DISK_FULL
            return EpisodeOutcome(number, fault=f"cannot be written: {error}", stops=is_full)
        except _AnotherError as error:
            return EpisodeOutcome(number, fault=str(error), stops=True)
        except Exception as error:
            _log.exception("episode %d", number)
            kind = "" if isinstance(error, InterfaceError) else f"{type(error).__name__}: "
            return EpisodeOutcome(number, fault=kind + "; ".join(str(error).splitlines()))

    def _make(self, folder: EpisodeFolder, number: int) -> str:
        job = self._job
        started = datetime.now().astimezone().isoformat(timespec="seconds")
        seeds = f"seed {job.seed}, episode {number}, policy {job.policy}"
        episode, part = folder.begin(number, started=started, seeds=seeds, **job.facts)
        world: World | None = None
        try:
            world = new_world(self._loaded)
            self._check(world)
            with EpisodeBag(part / BAG, world, job.images) as bag:
                episode.label = EpisodeRun(job, self._policy, number, world).run(bag)
            episode.seconds = round(world.clock.time_s, 9)
            episode.state, episode.topics = "complete", measure_topics(part / BAG)
            folder.complete(part, episode)
        finally:
            shutil.rmtree(part, ignore_errors=True)  # it exists only after a fault
            if world is not None:
                world.close()
        return episode.label

    def _check(self, world: World) -> None:
        """Checks that the world's description is the description in the job. Only the first world is checked."""
        if not self._is_checked and digest(world.describe()) != self._job.world_sha256:
            raise _AnotherError(f"the world of {self._job.world}")
        self._is_checked = True


class _AnotherError(InterfaceError):
    """The world or the policy's file on this machine differs from that in the job. The argument names what differs."""

    def __str__(self) -> str:
        where = "another one here than where the farm was started"
        return f"{self.args[0]} is {where}: expected the same files, version of this workspace, and PyBullet"


Files = dict[str, bytes]
"""Contents of the files of an episode, indexed by file name."""


def make_remotely(job: FarmJob, number: int) -> tuple[EpisodeOutcome, Files]:
    """Makes an episode in a temporary folder of this node, and returns its outcome and its files.

    A failed episode has no files. If a fault prevents all further episodes, the message contains the node's name.
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
    """Writes the files of an episode that was made on another node into a folder.

    The episode's folder gets its final name when all files are written.

    Raises:
        OSError: If the episode cannot be written.
    """
    part = folder.part_of(number)
    shutil.rmtree(part, ignore_errors=True)
    part.mkdir()
    for name, content in files.items():
        path_below(part, name).write_bytes(content)
    part.rename(folder.folder_of(number))


@lru_cache(maxsize=1)
def _maker(job: FarmJob) -> EpisodeMaker:
    """Returns the cached maker of a job. A process on a node usually gets the same job again."""
    return EpisodeMaker(job)


def main() -> None:
    """Makes the requested episodes until the farm closes the connection."""
    connection = Connection(int(sys.argv[1]))
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the process that started it
    job, path = connection.recv()
    folder = EpisodeFolder(path)
    try:
        maker = EpisodeMaker(job)
    except InterfaceError as error:
        connection.send(EpisodeOutcome(-1, fault=str(error), stops=True))
        return
    while True:
        try:
            number = connection.recv()
        except EOFError:
            return
        connection.send(maker.make(folder, number))


if __name__ == "__main__":
    main()
