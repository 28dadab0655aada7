"""Starts the shadow process of a world, and sends requests to the shadow and its forks."""

from __future__ import annotations

import gc
import os
import signal
import subprocess
import threading
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from multiprocessing.connection import Connection, Pipe
from multiprocessing.reduction import send_handle
from pathlib import Path
from typing import Any

from custom_ros_tools.child_process import python_module, start_child
from custom_ros_tools.errors import InterfaceError
from rpbi.world.saved.command_log import RecordedCommand
from rpbi.world.saved.state import WorldState

from .following import end_with, serve
from .prediction import Candidate, Prediction, PredictionJob

_STDERR = 2
MAX_COPIED_MB = 200.0
"""Largest memory of a process that is copied [MB]; forking takes 0.04 ms per MB, and a new program needs 60 MB."""


class Remote:
    """A process at the other end of a connection, which answers each request with a result or an error.

    Args:
        connection: Connection to the process.
        subject: Name of the process, for messages.
    """

    def __init__(self, connection: Connection, subject: str) -> None:
        self._connection, self._subject = connection, subject
        self._unanswered = 0
        """Number of requests that were sent by `begin`."""

    def begin(self, name: str, *arguments: Any) -> None:
        """Sends a request without waiting for the answer.

        The next call of `ask` first waits for this answer, and raises an InterfaceError if the answer is an error.

        Raises:
            InterfaceError: If the other process has ended.
        """
        try:
            self._connection.send((name, arguments))
        except OSError as error:
            raise self._ended(error) from None
        self._unanswered += 1

    def ask(self, name: str, *arguments: Any, handle: int | None = None) -> Any:
        """Sends a request, waits for the answer, and returns the result.

        Args:
            name: Name of the request.
            arguments: Arguments of the request; they must be picklable.
            handle: File descriptor to send with the request; None sends no file descriptor.

        Raises:
            InterfaceError: If the answer is an error, or the other process has ended.
        """
        while self._unanswered:
            self._unanswered -= 1
            self.answer()
        try:
            self._connection.send((name, arguments))
            if handle is not None:
                send_handle(self._connection, handle, 0)
                os.set_blocking(
                    self._connection.fileno(), True
                )  # non-blocking by now if sockets have a default timeout
        except OSError as error:
            raise self._ended(error) from None
        return self.answer()

    def answer(self) -> Any:
        """Waits for the answer to the oldest unanswered request, and returns the result.

        Raises:
            InterfaceError: If the answer is an error, or the other process has ended.
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
        """Closes the connection, which makes the other process end."""
        self._connection.close()


class Fork(Remote):
    """A copy of a world in another process, made from the world's state; leaving a `with` block ends the process."""

    def put(self, slot: str, value: Any) -> None:
        """Sends a value to an input of the fork's world, see `World.put`."""
        self.ask("put", slot, value)

    def act(self, name: str, what: str, value: Any) -> None:
        """Applies an action to a body of the fork's world, see `World.act`; the action's result is not returned."""
        self.ask("act", name, what, value)

    def step(self, ticks: int = 1) -> list[Any]:
        """Advances the fork's world by `ticks` ticks, and returns the sensor samples of all these ticks."""
        return list(self.ask("step", ticks))

    def state_hash(self) -> str:
        """Returns the hash of the fork's present state, see `World.state_hash`."""
        return str(self.ask("state_hash"))

    def call(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """Calls a function in the fork with the fork's `World` and further arguments, and returns the result.

        Args:
            function: Module-level function.
            arguments: Further arguments; they and the result must be picklable.
        """
        return self.ask("call", function, *arguments)

    def __enter__(self) -> Fork:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class _Copy:
    """A fork of this process that calls a function; the fork ends when the function returns or this process ends.

    Args:
        call: Function to call in the fork.
        keep: File descriptor that stays open in the fork, besides standard error. The fork redirects all other file
            descriptors to /dev/null. Otherwise pipes would stay open in the fork after this process closes them.
    """

    stdin = None

    def __init__(self, call: Callable[[], None], keep: int) -> None:
        parent = os.getpid()
        self._pid = os.fork()
        if self._pid:
            return
        try:
            gc.freeze()  # the fork must not finalize garbage of this process, such as temporary folders
            end_with(parent)
            nowhere = os.open(os.devnull, os.O_RDWR)
            for file in map(int, os.listdir("/proc/self/fd")):
                if file not in (keep, _STDERR):
                    with suppress(OSError):  # raised for the descriptor of the listed folder, which is closed already
                        os.dup2(nowhere, file)
            call()
        finally:
            os._exit(0)

    def kill(self) -> None:
        """Kills the fork."""
        with suppress(ProcessLookupError):
            os.kill(self._pid, signal.SIGKILL)

    def wait(self) -> None:
        """Waits until the fork has ended."""
        with suppress(ChildProcessError):
            os.waitpid(self._pid, 0)


class Shadow:
    """A process that repeats a world's commands, and is forked to copy the world and to make predictions.

    The shadow has no ROS node, no window and a single thread, so it can be forked safely. The shadow starts while this
    process continues; the first request waits until the shadow has reached the world's state.

    Args:
        connection: Connection to the shadow.
        process: Process of the shadow.
        commands: Number of the world's commands that the shadow has received.
    """

    def __init__(self, connection: Connection, process: subprocess.Popen[bytes] | _Copy, commands: int) -> None:
        self._remote, self._process = Remote(connection, "the process that follows the world"), process
        self.commands = commands
        """Number of the world's commands that the shadow has received."""

    @classmethod
    def of(cls, world: Any, state: WorldState) -> Shadow:
        """Starts a shadow of a `World` in its present state: a fork of this process if possible, else a new program."""
        return cls.copied(world) or cls.started(state, world.commands.count)

    @classmethod
    def copied(cls, world: Any) -> Shadow | None:
        """Starts a shadow that is a fork of this process.

        Returns None instead if this process has more than MAX_COPIED_MB of memory, a window, or several threads. A fork
        does not have the other threads, and would wait forever for locks that these threads held.
        """
        if world.pb.has_window or threading.active_count() > 1 or _memory_mb() > MAX_COPIED_MB:
            return None
        ours, theirs = Pipe()
        with theirs:
            process = _Copy(lambda: serve(theirs, lambda: world), theirs.fileno())
        if len(os.listdir("/proc/self/task")) > 1:  # not threads of OpenBLAS, which ends its threads before a fork
            process.kill()
            process.wait()
            ours.close()
            return None
        return cls(ours, process, world.commands.count)

    @classmethod
    def started(cls, state: WorldState, commands: int, niceness: int = 0) -> Shadow:
        """Starts a shadow that is a new program, which simulates until it reaches the state.

        Args:
            state: Present state of the world.
            commands: Number of commands since the world was built or reset.
            niceness: Increment of niceness over this process, from 0 to 19; a higher value means less processor time.
        """
        ours, theirs = Pipe()
        environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
        process = start_child(
            ["nice", "-n", str(niceness), *python_module("rpbi.follower", str(theirs.fileno()))],
            signal.SIGKILL,
            pass_fds=[theirs.fileno()],
            env=environment,
            stdout=subprocess.DEVNULL,
        )
        theirs.close()
        with suppress(OSError):  # if the shadow has ended, its first request reports this
            ours.send(state)
        return cls(ours, process, commands)

    def restore(self, state: WorldState, commands: int) -> None:
        """Makes the shadow restore a state, without waiting for the result.

        This is needed after the world has made a keyframe and dropped all earlier commands. A shadow that has not
        received all of the dropped commands cannot reach the world's present state in another way.

        Args:
            state: Present state of the world.
            commands: Number of commands since the world was built or reset.
        Raises:
            InterfaceError: If the shadow has ended.
        """
        self._remote.begin("restore", state)
        self.commands = commands

    @property
    def is_copy(self) -> bool:
        """Whether the shadow is a fork of this process.

        If so, replacing the shadow by a new fork is faster than making the shadow restore a state.
        """
        return isinstance(self._process, _Copy)

    def follow(self, commands: Iterable[RecordedCommand], tick: int, state_hash: str) -> None:
        """Brings the shadow to the world's present state, before the shadow forks or predicts.

        Args:
            commands: Commands of the world that the shadow does not have yet.
            tick: Present tick of the world.
            state_hash: Hash of the world's present state.

        Raises:
            InterfaceError: If the state that the shadow reaches has another hash.
        """
        new = tuple(commands)
        self._remote.ask("follow", new, tick, state_hash)
        self.commands += len(new)

    def fork(self, count: int) -> list[Fork]:
        """Forks the shadow `count` times, and returns the forks."""
        forks = []
        for index in range(count):
            ours, theirs = Pipe()
            with theirs:
                self._remote.ask("fork", handle=theirs.fileno())
            forks.append(Fork(ours, f"fork {index}"))
        return forks

    def predict(self, candidates: Sequence[Candidate], job: PredictionJob, jobs: int) -> list[Prediction]:
        """Makes a prediction for each candidate (sequence of inputs); at most `jobs` processes run at a time."""
        return list(self._remote.ask("predict", [list(each) for each in candidates], job, jobs))

    def kill(self) -> None:
        """Kills the shadow and its predictions; a request that waits in another thread raises an InterfaceError."""
        self._process.kill()

    def close(self) -> None:
        """Ends the shadow and its predictions; its forks continue until they are closed."""
        self._remote.close()
        self._process.kill()
        self._process.wait()
        if self._process.stdin is not None:
            self._process.stdin.close()


def _memory_mb() -> float:
    """Returns the resident memory of this process without file-backed pages [MB], see proc_pid_statm(5)."""
    _, resident, shared, *_ = map(int, Path("/proc/self/statm").read_text().split())
    return (resident - shared) * os.sysconf("SC_PAGE_SIZE") / 1e6
