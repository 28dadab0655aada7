"""The world's side of the process that follows it, and of forks."""

from __future__ import annotations

import gc
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from multiprocessing.connection import Connection, Pipe
from multiprocessing.reduction import send_handle
from pathlib import Path
from typing import Any

from custom_ros_tools.child_process import start_child
from custom_ros_tools.errors import InterfaceError
from rpbi.world.saved.command_log import RecordedCommand
from rpbi.world.saved.state import WorldState

from .following import end_with, serve
from .prediction import Candidate, Prediction, PredictionJob

_STDERR = 2
MAX_COPIED_MB = 200.0
"""Largest memory of a process that is copied [MB]: forking a copy takes 0.04 ms per MB, and a new program has 60 MB."""


class Remote:
    """The other end of a connection, which answers each request with its result or an error."""

    def __init__(self, connection: Connection, subject: str) -> None:
        self._connection, self._subject = connection, subject
        self._unanswered = 0
        """Number of requests that were sent by `begin`."""

    def begin(self, name: str, *arguments: Any) -> None:
        """Sends a request without waiting; the next `ask` waits for its answer first, and raises if that is an error.

        Raises:
            InterfaceError: If the other end has ended.
        """
        try:
            self._connection.send((name, arguments))
        except OSError as error:
            raise self._ended(error) from None
        self._unanswered += 1

    def ask(self, name: str, *arguments: Any, handle: int | None = None) -> Any:
        """Returns the answer to a request, which may come with a file handle.

        Raises:
            InterfaceError: If the other end refuses, or has ended.
        """
        while self._unanswered:
            self._unanswered -= 1
            self.answer()
        try:
            self._connection.send((name, arguments))
            if handle is not None:
                send_handle(self._connection, handle, 0)
                os.set_blocking(self._connection.fileno(), True)  # a default timeout of sockets may have changed it
        except OSError as error:
            raise self._ended(error) from None
        return self.answer()

    def answer(self) -> Any:
        """Returns the answer to a request that was sent.

        Raises:
            InterfaceError: If the other end refuses, or has ended.
        """
        try:
            is_good, answer = self._connection.recv()
        except (EOFError, OSError) as error:
            raise self._ended(error) from None
        if not is_good:
            raise InterfaceError(f"{self._subject}: {answer}")
        return answer

    def _ended(self, error: Exception) -> InterfaceError:
        return InterfaceError(f"{self._subject} has ended: {error or 'its memory may have run out'}")

    def close(self) -> None:
        """Ends the other end."""
        self._connection.close()


class Fork(Remote):
    """A world in a process of its own, which continues from the state of another one; `with` ends it."""

    def put(self, slot: str, value: Any) -> None:
        """Passes a value to a body before its next tick, see `World.put`."""
        self.ask("put", slot, value)

    def act(self, name: str, what: str, value: Any) -> None:
        """Applies an action to a body, see `World.act`."""
        self.ask("act", name, what, value)

    def step(self, ticks: int = 1) -> list[Any]:
        """Advances by ticks, and returns all samples."""
        return list(self.ask("step", ticks))

    def state_hash(self) -> str:
        """Returns the hash of its state, see `World.state_hash`."""
        return str(self.ask("state_hash"))

    def call(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """Returns what a function of a module returns for the `World` of the fork, and further arguments."""
        return self.ask("call", function, *arguments)

    def __enter__(self) -> Fork:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class _Copy:
    """A copy of this process in which a function is called, and which ends when that returns or this process ends.

    Args:
        call: The function.
        keep: File descriptor that the copy keeps. All others lead to /dev/null there, so that a reader of a pipe that
            this process closes does not wait for the copy, too.
    """

    stdin = None

    def __init__(self, call: Callable[[], None], keep: int) -> None:
        parent = os.getpid()
        self._pid = os.fork()
        if self._pid:
            return
        try:
            gc.freeze()  # garbage of this process is not the copy's to finish, such as folders that would be removed
            end_with(parent)
            nowhere = os.open(os.devnull, os.O_RDWR)
            for file in map(int, os.listdir("/proc/self/fd")):
                if file not in (keep, _STDERR):
                    with suppress(OSError):  # the folder itself
                        os.dup2(nowhere, file)
            call()
        finally:
            os._exit(0)

    def kill(self) -> None:
        """Ends the copy."""
        with suppress(ProcessLookupError):
            os.kill(self._pid, signal.SIGKILL)

    def wait(self) -> None:
        """Waits until it has ended."""
        with suppress(ChildProcessError):
            os.waitpid(self._pid, 0)


class Shadow:
    """The process that follows a world; it has neither ROS nor a window nor a second thread, and may therefore fork.

    It starts while this process continues; the first call waits until it has reached the state.

    Args:
        connection: Connection to it.
        process: The process.
        commands: Number of commands that it knows.
    """

    def __init__(self, connection: Connection, process: subprocess.Popen[bytes] | _Copy, commands: int) -> None:
        self._remote, self._process = Remote(connection, "the process that follows the world"), process
        self.commands = commands
        """Number of commands that it knows."""

    @classmethod
    def of(cls, world: Any, state: WorldState) -> Shadow:
        """Returns one for a `World` at its present state: a copy of this process if possible, else a new program."""
        return cls.copied(world) or cls.started(state, world.commands.count)

    @classmethod
    def copied(cls, world: Any) -> Shadow | None:
        """Returns one that is a copy of this process; None if this process is large, has other threads or a window.

        A copy has none of the threads, and would wait for ever for the locks that they held.
        """
        if world.pb.has_window or threading.active_count() > 1 or _memory_mb() > MAX_COPIED_MB:
            return None
        ours, theirs = Pipe()
        with theirs:
            process = _Copy(lambda: serve(theirs, lambda: world), theirs.fileno())
        if len(os.listdir("/proc/self/task")) > 1:  # those of OpenBLAS have ended: it ends them before a fork
            process.kill()
            process.wait()
            ours.close()
            return None
        return cls(ours, process, world.commands.count)

    @classmethod
    def started(cls, state: WorldState, commands: int, niceness: int = 0) -> Shadow:
        """Returns one that is a new program, which simulates again until it reaches the state.

        Args:
            state: Present state of the world.
            commands: Number of commands of the world so far.
            niceness: Niceness above that of this process, from 0 to 19; more means less processor time.
        """
        ours, theirs = Pipe()
        environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
        process = start_child(
            ["nice", "-n", str(niceness), sys.executable, "-P", "-m", "rpbi.follower", str(theirs.fileno())],
            signal.SIGKILL,
            pass_fds=[theirs.fileno()],
            env=environment,
            stdout=subprocess.DEVNULL,
        )
        theirs.close()
        with suppress(OSError):  # the first call reports that it has ended
            ours.send(state)
        return cls(ours, process, commands)

    def restore(self, state: WorldState, commands: int) -> None:
        """Sends it to a later keyframe and on to the state, since commands on the way were dropped; does not wait.

        Args:
            state: Present state of the world.
            commands: Number of commands of the world so far.

        Raises:
            InterfaceError: If it has ended.
        """
        self._remote.begin("restore", state)
        self.commands = commands

    @property
    def is_copy(self) -> bool:
        """Whether it is a copy of this process; another copy is made faster than it restores a state."""
        return isinstance(self._process, _Copy)

    def follow(self, commands: Iterable[RecordedCommand], tick: int, state_hash: str) -> None:
        """Brings it to the present tick of the world, before it forks or predicts.

        Raises:
            InterfaceError: If its state then has another hash.
        """
        new = tuple(commands)
        self._remote.ask("follow", new, tick, state_hash)
        self.commands += len(new)

    def fork(self, count: int) -> list[Fork]:
        """Returns forks of it."""
        forks = []
        for index in range(count):
            ours, theirs = Pipe()
            with theirs:
                self._remote.ask("fork", handle=theirs.fileno())
            forks.append(Fork(ours, f"fork {index}"))
        return forks

    def predict(self, candidates: Sequence[Candidate], job: PredictionJob, jobs: int) -> list[Prediction]:
        """Returns the prediction of each candidate."""
        return list(self._remote.ask("predict", [list(each) for each in candidates], job, jobs))

    def kill(self) -> None:
        """Ends it and its predictions; a call that waits in another thread raises an InterfaceError."""
        self._process.kill()

    def close(self) -> None:
        """Ends it; forks continue until they are closed."""
        self._remote.close()
        self._process.kill()
        self._process.wait()
        if self._process.stdin is not None:
            self._process.stdin.close()


def _memory_mb() -> float:
    """Returns the memory of this process that is in no file [MB]; see proc_pid_statm(5)."""
    _, resident, shared, *_ = map(int, Path("/proc/self/statm").read_text().split())
    return (resident - shared) * os.sysconf("SC_PAGE_SIZE") / 1e6
