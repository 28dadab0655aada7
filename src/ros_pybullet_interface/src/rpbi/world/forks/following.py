"""The process that follows a world: it repeats the world's commands, and forks itself for forks and predictions."""

from __future__ import annotations

import ctypes
import os
import pickle
import select
import signal
from collections.abc import Callable, Iterator, Sequence
from multiprocessing.connection import Connection
from multiprocessing.reduction import recv_handle
from typing import Any

from custom_ros_tools.errors import InterfaceError
from rpbi.world.saved.command_log import RecordedCommand, apply_command
from rpbi.world.saved.state import WorldState

from .prediction import Candidate, Prediction, PredictionJob, predict

PIPE_BYTES = 1 << 20
_PR_SET_PDEATHSIG = 1
"""prctl(2): the signal when the thread that has forked ends, which is the only one here."""


def end_with(parent: int) -> None:
    """Makes this process, a fork, end as soon as its parent ends."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:  # it ended before
        os._exit(0)


def serve(connection: Connection, build: Callable[[], Any]) -> None:
    """Answers requests of a `Shadow` until the other end is closed.

    Args:
        connection: Connection to it.
        build: Returns the `World`; the first request gets its errors.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the process that it follows
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # so that forks leave no zombies
    world: Any = None
    fault: Exception | None = None
    try:
        world = build()
    except Exception as error:
        fault = error

    def follow(commands: Sequence[RecordedCommand], tick: int, state_hash: str) -> None:
        if fault is not None:
            raise fault
        _advance(world, commands, tick)
        if (reached := world.state_hash()) != state_hash:
            raise InterfaceError(
                f"tick {tick}: expected the state {state_hash}, got {reached}; something not recorded acts"
            )

    def restore(state: WorldState) -> None:
        if fault is not None:
            raise fault
        world.restore(state, trust=None, max_ticks=state.tick)

    def fork() -> None:
        with Connection(recv_handle(connection)) as own:
            os.set_blocking(connection.fileno(), True)  # a default time-out of sockets would have changed it
            if os.fork():
                return
            try:
                connection.close()
                _answer(own, _requests_of(world))
            finally:
                os._exit(0)

    def predictions(candidates: Sequence[Candidate], job: PredictionJob, jobs: int) -> list[Prediction]:
        return list(_predict_all(world, candidates, job, jobs))

    _answer(connection, {"restore": restore, "follow": follow, "fork": fork, "predict": predictions})


def _advance(world: Any, commands: Sequence[RecordedCommand], tick: int) -> None:
    waiting = list(commands)
    while True:
        while waiting and waiting[0].tick <= world.clock.tick:
            apply_command(world, waiting.pop(0), trust=None)  # the followed world has applied it
        if world.clock.tick >= tick:
            return
        world.step()


def _requests_of(world: Any) -> dict[str, Callable[..., Any]]:
    """Returns the requests that a fork answers, by name."""
    return {
        "put": world.put,
        "act": lambda *arguments: world.act(*arguments) and None,
        "step": lambda ticks: [sample for _ in range(ticks) for sample in world.step()],
        "state_hash": world.state_hash,
        "call": lambda function, *arguments: function(world, *arguments),
    }


def _answer(connection: Connection, requests: dict[str, Callable[..., Any]]) -> None:
    while True:
        try:
            request = connection.recv_bytes()
        except (EOFError, OSError):
            return
        try:
            name, arguments = pickle.loads(request)  # which may name a function that is not known here
            answer = pickle.dumps((True, requests[name](*arguments)))
        except Exception as error:
            answer = pickle.dumps((False, _words(error)))
        try:
            connection.send_bytes(answer)
        except OSError:  # nobody waits for the answer any more
            return


def _words(error: Exception) -> str:
    return str(error) if isinstance(error, (InterfaceError, ValueError)) else f"{type(error).__name__}: {error}"


def _predict_all(world: Any, candidates: Sequence[Candidate], job: PredictionJob, jobs: int) -> Iterator[Prediction]:
    """Yields the predictions of candidates, each from a fork of its own, `jobs` at a time."""
    waiting = list(enumerate(candidates))
    answers: dict[int, list[bytes]] = {}
    running: dict[int, int] = {}
    try:
        while waiting or running:
            while waiting and len(running) < jobs:
                index, candidate = waiting.pop(0)
                running[_start(world, candidate, job)] = index
                answers[index] = []
            for pipe in select.select(list(running), [], [])[0]:
                if part := os.read(pipe, PIPE_BYTES):
                    answers[running[pipe]].append(part)
                else:
                    os.close(pipe)
                    del running[pipe]
    finally:
        for pipe in running:
            os.close(pipe)
    for index in range(len(candidates)):
        yield _read(b"".join(answers[index]))


def _start(world: Any, candidate: Candidate, job: PredictionJob) -> int:
    """Forks, and returns the pipe from which the prediction can be read.

    Raises:
        OSError: If there is no memory, or no process, for the fork.
    """
    reading, writing = os.pipe()
    parent = os.getpid()
    try:
        is_here = os.fork() > 0
    except OSError:
        os.close(reading)
        os.close(writing)
        raise
    if is_here:
        os.close(writing)
        return reading
    try:  # whatever fails here ends the fork, which must not serve in place of this process
        end_with(parent)
        os.close(reading)
        prediction = _predicted(world, candidate, job)
        with open(writing, "wb") as pipe:
            pipe.write(pickle.dumps(prediction))
    finally:
        os._exit(0)


def _predicted(world: Any, candidate: Candidate, job: PredictionJob) -> Prediction:
    try:
        return predict(world, candidate, job)
    except Exception as error:
        return Prediction(float("inf"), fault=_words(error))


def _read(text: bytes) -> Prediction:
    """Returns a prediction; text that is missing or cut short is a fault."""
    try:
        prediction: Prediction = pickle.loads(text)
    except Exception:  # text that ends anywhere
        return Prediction(float("inf"), fault="its process ended early: its memory may have run out")
    return prediction
