"""Runs the shadow process, which repeats the commands of a world, and forks itself for copies and predictions."""

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
"""Option of prctl(2): signal that a process gets when the thread that forked it ends; this process has one thread."""


def end_with(parent: int) -> None:
    """Makes this process, which was just forked, end as soon as the parent process ends.

    Args:
        parent: Process id of the parent.
    """
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:  # the parent has ended already
        os._exit(0)


def serve(connection: Connection, build: Callable[[], Any]) -> None:
    """Answers requests of a `Shadow` until the `Shadow` closes the connection.

    Args:
        connection: Connection to the `Shadow`.
        build: Function that builds the `World`. An error of this function is returned as the answer to each `follow`
            or `restore` request.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the process whose world is followed
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
            os.set_blocking(connection.fileno(), True)  # non-blocking by now if sockets have a default timeout
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
            apply_command(world, waiting.pop(0), trust=None)  # trusted, since the followed world has applied it
        if world.clock.tick >= tick:
            return
        world.step()


def _requests_of(world: Any) -> dict[str, Callable[..., Any]]:
    """Returns the functions that answer requests to a fork, indexed by the request's name."""
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
            name, arguments = pickle.loads(request)  # fails if an argument is a function that is not known here
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
    """Makes a prediction for each candidate (sequence of inputs) in a separate fork, and yields the prediction.

    At most `jobs` forks run at a time.
    """
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
    """Starts a prediction in a fork, and returns the file descriptor from which the result can be read.

    Raises:
        OSError: If the process cannot be forked, for instance for lack of memory.
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
    try:  # after any error the fork ends, since it must not go on to answer requests like its parent
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
    """Returns the prediction that a fork sent; if the text is incomplete, returns a prediction with a fault."""
    try:
        prediction: Prediction = pickle.loads(text)
    except Exception:  # unpickling an incomplete text may fail in any way
        return Prediction(float("inf"), fault="its process ended early: its memory may have run out")
    return prediction
