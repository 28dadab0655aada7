"""Parts of a recording, replayed by several processes at once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from multiprocessing import get_context
from multiprocessing.connection import Connection
from typing import Any, TypeVar

from custom_ros_tools.errors import InterfaceError

from .session import RecordedPart, ReplayResult

Result = TypeVar("Result")


def groups_of(parts: Sequence[RecordedPart], jobs: int) -> list[Sequence[RecordedPart]]:
    """Returns parts in at most so many groups of neighbours, of about the same number each."""
    count = max(1, min(jobs, len(parts)))
    bounds = [len(parts) * index // count for index in range(count + 1)]
    return [parts[begin:end] for begin, end in zip(bounds, bounds[1:])]


def in_forks(
    work: Callable[[Sequence[RecordedPart]], Result], groups: Sequence[Sequence[RecordedPart]]
) -> list[Result]:
    """Returns the results of a function for groups, each in a fork of this process if there are several.

    Raises:
        InterfaceError: If the function raises one, or a process ends early.
    """
    if len(groups) == 1:
        return [work(groups[0])]
    context = get_context("fork")  # which has the recording already
    running = []
    for group in groups:
        ours, theirs = context.Pipe(duplex=False)
        process = context.Process(target=_send, args=(theirs, work, group), daemon=True)
        process.start()
        theirs.close()
        running.append((process, ours))
    answers = [_received(ours) for _, ours in running]
    for process, _ in running:
        process.join()
    for fault, _ in answers:
        if fault:
            raise InterfaceError(fault)
    return [result for _, result in answers]


def merged(results: Sequence[ReplayResult]) -> ReplayResult:
    """Returns the results of groups as that of the whole."""
    return ReplayResult(
        sum(each.agreed for each in results),
        sum(each.ticks for each in results),
        next((each.difference for each in results if each.difference is not None), None),
        tuple(text for each in results for text in each.left_out),
    )


def _send(connection: Connection, work: Callable[[Sequence[RecordedPart]], Any], group: Sequence[RecordedPart]) -> None:
    try:
        answer = "", work(group)
    except Exception as error:  # a recording may have anything in it
        answer = str(error) if isinstance(error, InterfaceError) else f"{type(error).__name__}: {error}", None
    connection.send(answer)


def _received(connection: Connection) -> tuple[str, Any]:
    try:
        fault, result = connection.recv()
    except EOFError:
        return "a process ended early: its memory may have run out", None
    return fault, result
