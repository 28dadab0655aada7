"""Process that connects a farm to a Ray cluster, started as `python -m rpbi_data.farm.ros.cluster FD ADDRESS`.

FD is the file descriptor of the connection to the farm.

This process is separate from the farm because Ray ends the client process when the head node of the cluster ends.
"""

from __future__ import annotations

import logging
import os
import shutil
import signal
import socket
import sys
from collections.abc import Iterator
from multiprocessing.connection import Connection
from typing import Any

from custom_ros_tools.errors import InterfaceError
from rpbi_data.episodes.folder import EpisodeFolder
from rpbi_data.farm.job import EpisodeOutcome, FarmJob

from .maker import make_remotely, store

POLL_S = 0.2
"""Maximum time between two checks for new requests [s]."""
HEAD_TIMEOUT_S = 5.0
"""Time without an answer after which the head node counts as unreachable [s]."""


class Cluster:
    """Makes episodes on the nodes of a Ray cluster.

    Args:
        address: Address of the head node as `HOST:PORT`, as `ray start` prints it, or `auto`.
        job: Job that determines the episodes.
        folder: Folder on this machine into which complete episodes are written.

    Raises:
        ClusterError: If the cluster cannot be used.
    """

    def __init__(self, address: str, job: FarmJob, folder: EpisodeFolder) -> None:
        import ray  # an extra, which takes seconds to import

        self._ray, self._folder, self._address = ray, folder, address
        if address != "auto":
            self._require_head()
        try:
            ray.init(address, log_to_driver=False, logging_level=logging.ERROR)
        except Exception as error:  # Ray raises many kinds of errors
            raise ClusterError(address, f"cannot be used: {' '.join(str(error).split())}") from error
        self._address = ray.get_runtime_context().gcs_address
        self._job = ray.put(job)
        self._task = ray.remote(num_cpus=1, max_retries=0)(make_remotely)
        self._numbers: dict[Any, int] = {}

    def start(self, number: int) -> None:
        """Requests an episode from the cluster."""
        self._numbers[self._task.remote(self._job, number)] = number

    def outcomes(self) -> Iterator[EpisodeOutcome]:
        """Waits at most `POLL_S` for an episode to finish. If an episode has finished, yields its outcome.

        Raises:
            ClusterError: If the head node does not answer.
        """
        self._require_head()
        if not self._numbers:
            return
        for reference in self._ray.wait(list(self._numbers), num_returns=1, timeout=POLL_S)[0]:
            yield self._outcome(reference, self._numbers.pop(reference))

    def _outcome(self, reference: Any, number: int) -> EpisodeOutcome:
        try:
            outcome, files = self._ray.get(reference)
        except self._ray.exceptions.RayTaskError as error:  # raised by the task itself
            return EpisodeOutcome(number, fault=str(error).strip().splitlines()[-1])
        except self._ray.exceptions.RayError as error:
            self._require_head()
            return EpisodeOutcome(number, fault=f"its process ended ({type(error).__name__})", is_lost=True)
        if files:
            try:
                store(self._folder, number, files)
            except OSError as error:
                shutil.rmtree(self._folder.part_of(number), ignore_errors=True)
                return EpisodeOutcome(number, fault=f"cannot be written: {error}", stops=True)
        result: EpisodeOutcome = outcome
        return result

    def _require_head(self) -> None:
        host, _, port = self._address.rpartition(":")
        try:
            socket.create_connection((host, int(port)), HEAD_TIMEOUT_S).close()
        except (OSError, ValueError) as error:
            raise ClusterError(self._address, f"the head of the Ray cluster does not answer: {error}") from error


class ClusterError(InterfaceError):
    """Raised if a Ray cluster cannot be used."""

    def __init__(self, address: str, message: str) -> None:
        super().__init__(address, message)
        self._text = f"{address}: {message}"

    def __str__(self) -> str:
        return self._text


def main() -> None:
    """Forwards the farm's requests to the cluster, and outcomes to the farm, until the farm closes the connection."""
    connection = Connection(int(sys.argv[1]))
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the process that started it
    job, path = connection.recv()
    try:
        cluster = Cluster(sys.argv[2], job, EpisodeFolder(path))
        while True:
            while connection.poll(0.0):
                cluster.start(connection.recv())
            for outcome in cluster.outcomes():
                connection.send(outcome)
    except EOFError:
        return
    except ClusterError as error:
        connection.send(EpisodeOutcome(-1, fault=str(error), stops=True))
        os._exit(1)  # a normal exit would wait for the head node


if __name__ == "__main__":
    main()
