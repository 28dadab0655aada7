"""A process that follows a world and forks itself, from the world's point of view."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from multiprocessing.connection import Connection, Pipe
from multiprocessing.reduction import send_handle
from typing import Any

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.processes.child import start_child
from rpbi.world.saved.command_log import RecordedCommand
from rpbi.world.saved.state import WorldState

from .prediction import Candidate, Prediction, PredictionJob


class Remote:
    """The other end of a connection, which answers each request with its result or an error."""

    def __init__(self, connection: Connection, subject: str) -> None:
        self._connection, self._subject = connection, subject

    def ask(self, name: str, *arguments: Any, handle: int | None = None) -> Any:
        """Returns the answer to a request, which may come with a file handle.

        Raises:
            InterfaceError: If the other end refuses, or has ended.
        """
        try:
            self._connection.send((name, arguments))
            if handle is not None:
                send_handle(self._connection, handle, 0)
                os.set_blocking(self._connection.fileno(), True)  # a default time-out of sockets has changed it
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
    """A world in a process of its own, which goes on from where another one was; as a context it ends with it."""

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


class Shadow:
    """The process; it has neither ROS nor a window nor a second thread, and may therefore fork.

    It starts while this one goes on; the first call waits until it has come to the state.

    Args:
        state: Present state of the world.
        niceness: How much less of the processors it gets than this process, from 0 to 19.
    """

    def __init__(self, state: WorldState, niceness: int = 0) -> None:
        ours, theirs = Pipe()
        environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
        self._process = start_child(
            ["nice", "-n", str(niceness), sys.executable, "-P", "-m", "rpbi.follower", str(theirs.fileno())],
            signal.SIGKILL,
            pass_fds=[theirs.fileno()],
            env=environment,
            stdout=subprocess.DEVNULL,
        )
        theirs.close()
        self._remote = Remote(ours, "the process that follows the world")
        self.commands = len(state.commands)
        """Number of commands that it knows."""
        self._is_starting = True
        with suppress(OSError):  # the first call reports that it has ended
            ours.send(state)
            ours.send(("follow", ((), state.tick, state.state_hash)))

    def follow(self, commands: Iterable[RecordedCommand], tick: int, state_hash: str) -> None:
        """Brings it to the present tick of the world, before it forks or predicts.

        Raises:
            InterfaceError: If its state then has another hash.
        """
        new = tuple(commands)
        if self._is_starting:
            self._remote.answer()
            self._is_starting = False
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
        """Returns what happens with each candidate."""
        return list(self._remote.ask("predict", [list(each) for each in candidates], job, jobs))

    def close(self) -> None:
        """Ends it; forks go on until they are closed."""
        self._remote.close()
        self._process.kill()
        self._process.wait()
        assert self._process.stdin is not None
        self._process.stdin.close()
