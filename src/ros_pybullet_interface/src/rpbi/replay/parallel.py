"""Calls functions on recordings in forks of this process, in parallel or with limited processor time."""

from __future__ import annotations

import resource
import signal
from collections.abc import Callable, Sequence
from functools import partial
from multiprocessing import get_context
from multiprocessing.connection import Connection
from typing import Any, TypeVar

from custom_ros_tools.child_process import limit_resource
from custom_ros_tools.errors import InterfaceError

from .session import RecordedPart, ReplayResult

Result = TypeVar("Result")


def groups_of(parts: Sequence[RecordedPart], jobs: int) -> list[Sequence[RecordedPart]]:
    """Splits parts into at most `jobs` groups of consecutive parts; all groups have about the same number of parts."""
    count = max(1, min(jobs, len(parts)))
    bounds = [len(parts) * index // count for index in range(count + 1)]
    return [parts[begin:end] for begin, end in zip(bounds, bounds[1:])]


def in_forks(
    work: Callable[[Sequence[RecordedPart]], Result], groups: Sequence[Sequence[RecordedPart]], cpu_s: int | None = None
) -> list[Result]:
    """Calls a function with each group of parts, and returns the results in the order of the groups.

    Two or more groups are processed in parallel, each in a fork of this process. A single group is processed in this
    process: `cpu_s` is then ignored, and errors of the function are raised unchanged.

    Args:
        work: Function that takes a group and returns a picklable result.
        groups: Groups of parts, see `groups_of`.
        cpu_s: Maximum processor time [s] of each fork; None means no limit.

    Raises:
        InterfaceError: If the function raises an error in a fork, or a fork ends without a result.
        TooSlowError: If a fork needs more processor time than `cpu_s`.
    """
    if len(groups) == 1:
        return [work(groups[0])]
    return _results([partial(work, group) for group in groups], cpu_s)


def in_limited_fork(work: Callable[[], Result], cpu_s: int) -> Result:
    """Calls a function in a fork of this process, and returns the function's result.

    Args:
        work: Function without arguments that returns a picklable result.
        cpu_s: Maximum processor time of the fork [s].

    Raises:
        InterfaceError: If the function raises an error, or the fork ends without a result.
        TooSlowError: If the fork needs more processor time than `cpu_s`.
    """
    return _results([work], cpu_s)[0]


def limit_cpu_time(cpu_s: int) -> None:
    """Limits the further processor time of this process. At the limit, the signal SIGXCPU ends this process.

    Args:
        cpu_s: Processor time [s] that this process may still use.
    """
    used = resource.getrusage(resource.RUSAGE_SELF)
    limit = cpu_s + int(used.ru_utime + used.ru_stime) + 1
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    limit_resource(resource.RLIMIT_CPU, limit, limit + 5)


class TooSlowError(InterfaceError):
    """A process needed more processor time than allowed.

    The first argument of the error is the allowed time [s].
    """

    def __str__(self) -> str:
        return (
            f"expected at most {self.args[0]:,} s of processor time, needs more; --max-cpu S, if you know who made it"
        )


def _results(calls: Sequence[Callable[[], Result]], cpu_s: int | None) -> list[Result]:
    context = get_context("fork")  # a fork has the recording in its memory already
    running = []
    for call in calls:
        ours, theirs = context.Pipe(duplex=False)
        process = context.Process(target=_send, args=(theirs, call, cpu_s), daemon=True)
        process.start()
        theirs.close()
        running.append((process, ours))
    answers = [_received(ours) for _, ours in running]
    for process, _ in running:
        process.join()
    if any(process.exitcode == -signal.SIGXCPU for process, _ in running):
        raise TooSlowError(cpu_s)
    for fault, _ in answers:
        if fault:
            raise InterfaceError(fault)
    return [result for _, result in answers]


def merged(results: Sequence[ReplayResult]) -> ReplayResult:
    """Combines results of consecutive groups of parts into the result of the whole recording."""
    return ReplayResult(
        sum(each.agreed for each in results),
        sum(each.ticks for each in results),
        next((each.difference for each in results if each.difference is not None), None),
        tuple(text for each in results for text in each.left_out),
    )


def _send(connection: Connection, call: Callable[[], Any], cpu_s: int | None) -> None:
    if cpu_s is not None:
        limit_cpu_time(cpu_s)
    try:
        answer = "", call()
    except Exception as error:  # a recording may contain invalid data
        answer = str(error) if isinstance(error, InterfaceError) else f"{type(error).__name__}: {error}", None
    connection.send(answer)


def _received(connection: Connection) -> tuple[str, Any]:
    try:
        fault, result = connection.recv()
    except EOFError:
        return "a process ended early: its memory may have run out", None
    return fault, result
