"""Processes that make episodes. Crashed processes are replaced."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from multiprocessing.connection import Pipe, wait
from pathlib import Path
from typing import Any

from custom_ros_tools.child_process import python_module, start_child
from custom_ros_tools.foreign import path_below
from rpbi_data.episodes.errors import EpisodeError
from rpbi_data.episodes.folder import EpisodeFolder

from .job import LOG, EpisodeOutcome, FarmJob

MAX_LOSSES = 3
"""Number of losses after which an episode is skipped. An episode is lost if the process that makes it ends."""
END_S = 5.0
"""Time to wait for a process to end after its connection is closed, before the process is killed [s]."""


class Child:
    """A child process that makes episodes. The child process is killed when this process ends.

    Args:
        module: Module that the child process runs. Its first command-line argument is the file descriptor from which
            the child process reads the job.
        job: Job that determines the episodes.
        folder: Folder of the episodes.
        slots: Maximum number of episodes requested from the child process at the same time.
        arguments: Further command-line arguments of the module.

    Raises:
        EpisodeError: If the log file is not an ordinary file.
    """

    def __init__(
        self, module: str, job: FarmJob, folder: EpisodeFolder, slots: int = 1, arguments: Sequence[str] = ()
    ) -> None:
        self._slots = slots
        self.numbers: set[int] = set()
        """Numbers of the episodes that were requested from the process and are not finished yet."""
        self.connection, theirs = Pipe()
        environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "PYTHONUNBUFFERED": "1"}
        path = path_below(folder.path, LOG)
        if path.exists() and not path.is_file():
            raise EpisodeError(path, "expected an ordinary file")
        with theirs, open(path, "ab") as log:
            self._process = start_child(
                python_module(module, str(theirs.fileno()), *arguments),
                signal.SIGKILL,
                pass_fds=[theirs.fileno()],
                env=environment,
                stdout=log,
                stderr=subprocess.STDOUT,
            )
        self._send((job, folder.path))

    @property
    def is_free(self) -> bool:
        """Whether another episode can be requested from the process."""
        return len(self.numbers) < self._slots

    def start(self, number: int) -> None:
        """Requests an episode from the process."""
        self.numbers.add(number)
        self._send(number)

    def receive(self) -> EpisodeOutcome | None:
        """Waits for the outcome of an episode and returns it, or None if the process has ended."""
        try:
            outcome: EpisodeOutcome = self.connection.recv()
        except (EOFError, OSError):
            return None
        self.numbers.discard(outcome.number)
        return outcome

    def close(self, grace_s: float = 0.0) -> str:
        """Closes the connection, and kills the process if it does not end by itself.

        Args:
            grace_s: Time to wait for the process to end by itself [s].

        Returns:
            The name of the signal that ended the process, such as `SIGKILL`, or a text such as `exit code 1`.
        """
        self.connection.close()
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(grace_s)
        self._process.kill()
        code = self._process.wait()
        assert self._process.stdin is not None
        self._process.stdin.close()
        return signal.Signals(-code).name if code < 0 else f"exit code {code}"

    def _send(self, message: Any) -> None:
        with suppress(BrokenPipeError, ConnectionResetError):  # the process has died, which `receive` reports
            self.connection.send(message)


class Pool:
    """Processes that make the episodes of a job. A process that dies is replaced, and its episode is made again.

    Args:
        folder: Folder of the episodes.
        new_child: Function that starts a process and returns its `Child`.
        size: Maximum number of processes.
        is_replaced: Whether a process that dies is replaced; otherwise, `run` ends with an error.
    """

    def __init__(
        self, folder: EpisodeFolder, new_child: Callable[[], Child], size: int, *, is_replaced: bool = True
    ) -> None:
        self._folder, self._new_child, self._size, self._is_replaced = folder, new_child, size, is_replaced
        self._children: list[Child] = []
        self._waiting: deque[int] = deque()
        self._losses: Counter[int] = Counter()

    def run(self, numbers: Sequence[int]) -> Iterator[EpisodeOutcome]:
        """Makes episodes, and yields the outcome of each episode when it is finished.

        When this generator ends, even early or with an exception, it ends all processes and removes the temporary
        folders of the episodes.

        Raises:
            EpisodeError: If no further episode can be made. Complete episodes are kept.
        """
        self._waiting.extend(numbers)
        for number in numbers:
            self._drop_part(number)
        try:
            while self._waiting or any(child.numbers for child in self._children):
                self._employ()
                ready = wait([child.connection for child in self._children])
                for child in [each for each in self._children if each.connection in ready]:
                    yield from self._outcomes(child)
        finally:
            self._end()
            for number in numbers:
                self._drop_part(number)

    def _employ(self) -> None:
        """Assigns waiting episodes to free processes; starts another process if all processes are busy."""
        while self._waiting:
            free = next((child for child in self._children if child.is_free), None)
            if free is None:
                if len(self._children) == self._size:
                    return
                free = self._new_child()
                self._children.append(free)
            free.start(self._waiting.popleft())

    def _outcomes(self, child: Child) -> Iterator[EpisodeOutcome]:
        outcome = child.receive()
        if outcome is None:
            self._children.remove(child)
            reason = child.close(END_S)
            if not self._is_replaced:
                raise EpisodeError(self._folder.path, f"the process that makes the episodes ended: {reason}")
            for number in sorted(child.numbers):
                yield from self._again(EpisodeOutcome(number, fault=f"its process ended ({reason})", is_lost=True))
        elif outcome.stops:
            subject = f"episode {outcome.number}: " if outcome.number >= 0 else ""
            raise EpisodeError(self._folder.path, subject + outcome.fault)
        elif outcome.is_lost:
            yield from self._again(outcome)
        else:
            yield outcome

    def _again(self, lost: EpisodeOutcome) -> Iterator[EpisodeOutcome]:
        """Schedules a lost episode again, or yields its outcome if it is complete or was lost `MAX_LOSSES` times."""
        number = lost.number
        self._drop_part(number)
        if self._folder.folder_of(number).exists():  # the process ended just after completing the episode
            yield EpisodeOutcome(number, self._folder.read(number).label)
            return
        self._losses[number] += 1
        if self._losses[number] < MAX_LOSSES:
            self._waiting.append(number)
        else:
            yield EpisodeOutcome(number, fault=f"left out: {MAX_LOSSES} times {lost.fault}")

    def _drop_part(self, number: int) -> None:
        part: Path = self._folder.part_of(number)
        shutil.rmtree(part, ignore_errors=True)

    def _end(self) -> None:
        while self._children:
            self._children.pop().close()
