"""A farm, which makes episodes with processes on this machine or on a Ray cluster."""

from __future__ import annotations

import fcntl
import importlib.util
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path

from custom_ros_tools.errors import ConfigError, MissingDependency, Problem
from rpbi.world.loading import load_world
from rpbi_data.episodes.errors import EpisodeError
from rpbi_data.episodes.files import store_files
from rpbi_data.episodes.folder import EpisodeFolder, git_state, versions
from rpbi_data.farm.job import EpisodeOutcome, FarmJob, digest, policy_digest
from rpbi_data.farm.policy import POLICIES
from rpbi_data.farm.pool import Child, Pool

from .maker import new_world

WORKER, CLUSTER = "rpbi_data.farm.ros.maker", "rpbi_data.farm.ros.cluster"
"""Modules of the child processes that make episodes: on this machine, and through a Ray cluster."""


class Farm:
    """Makes episodes in which a policy acts in a world.

    Args:
        world: Main YAML file of the world.
        policy: `module:Class` of the policy. The module may be in the current folder.
        seed: Seed of the farm.
        seconds: Simulated time after which an episode ends if its policy has not ended it [s].
        ticks: Number of ticks after which an episode ends, instead of `seconds`; 0 to use `seconds`.
        images: Whether the colour images of cameras are recorded.

    Raises:
        ConfigError: If the configuration of the world is wrong, the policy does not exist, or `images` is set but the
            world has no camera.
        PhysicsError: If PyBullet cannot load the world.
    """

    def __init__(
        self, world: str, policy: str, seed: int = 0, seconds: float = 10.0, ticks: int = 0, images: bool = False
    ) -> None:
        here = os.getcwd()
        if here not in sys.path:
            sys.path.append(here)
        found = POLICIES.configured(policy, "--policy")
        path = world if world.startswith(("{", "package://")) else str(Path(world).absolute())
        built = new_world(load_world(path))
        try:
            if images and not built.cameras:
                raise ConfigError([Problem(path, "rgbd_sensor", "expected a camera for --images, got none")])
            self._description = built.describe()
            length = ticks or max(1, round(seconds / built.clock.dt_s))
        finally:
            built.close()
        world_sha256, policy_sha256 = digest(self._description), policy_digest(found)
        self.job = FarmJob(path, policy, seed, length, world_sha256, policy_sha256, images, (here,))

    def missing(self, folder: EpisodeFolder, count: int) -> list[int]:
        """Returns the numbers below `count` of episodes that neither exist in the folder nor were discarded."""
        return sorted(set(range(count)) - folder.taken())

    @contextmanager
    def claimed(self, folder: EpisodeFolder) -> Iterator[None]:
        """Writes the job into a folder, and locks the folder for this farm within the context.

        Raises:
            EpisodeError: If the folder contains another job, or files but no job; or if the folder is locked by another
                farm, or cannot be written.
        """
        try:
            self.job.claim(folder.path)
            handle = os.open(folder.path, os.O_RDONLY)
        except OSError as error:
            raise EpisodeError(folder.path, f"cannot be written: {error}") from error
        try:
            _lock(handle, folder)
            yield
        finally:
            os.close(handle)

    def run(
        self,
        folder: EpisodeFolder,
        numbers: list[int],
        jobs: int,
        address: str | None = None,
        disk_reserve_mb: float = 200.0,
    ) -> Iterator[EpisodeOutcome]:
        """Makes episodes, and yields the outcome of each episode when it is finished.

        Args:
            folder: Folder of the episodes, which `claimed` has locked.
            numbers: Numbers of the episodes.
            jobs: Maximum number of processes on this machine.
            address: Address of a Ray cluster that makes the episodes instead of processes on this machine.
            disk_reserve_mb: Free disk space below which no further episode is made [MB].

        Raises:
            EpisodeError: If no further episode can be made. Complete episodes are kept.
            MissingDependency: If `address` is given and Ray is not installed.
        """
        if address is not None and importlib.util.find_spec("ray") is None:
            raise MissingDependency("ray", "./rpbi setup farm")
        job = replace(self.job, facts=self._facts(folder))
        if address is None:
            pool = Pool(folder, partial(Child, WORKER, job, folder), min(jobs, len(numbers)))
        else:
            pool = Pool(folder, partial(Child, CLUSTER, job, folder, len(numbers), (address,)), 1, is_replaced=False)
        _require_space(folder, disk_reserve_mb)
        for outcome in pool.run(numbers):
            yield outcome
            _require_space(folder, disk_reserve_mb)

    def _facts(self, folder: EpisodeFolder) -> dict[str, object]:
        """Copies the files of the world into the folder, and returns the attributes that all episodes share."""
        try:
            files, faults = store_files(self._description, folder.files)
        except OSError as error:
            raise EpisodeError(folder.path, f"cannot be written: {error}") from error
        return {"versions": versions(), "git": git_state(), "files": files, "note": "; ".join(faults)}


def _lock(handle: int, folder: EpisodeFolder) -> None:
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise EpisodeError(folder.path, "another farm is at work in it") from None


def _require_space(folder: EpisodeFolder, reserve_mb: float) -> None:
    if (free := folder.free_mb()) < reserve_mb:
        raise EpisodeError(folder.path, f"{free:.0f} MB free on the disk, less than the reserve of {reserve_mb:.0f} MB")
