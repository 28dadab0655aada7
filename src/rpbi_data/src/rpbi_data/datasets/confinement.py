"""Reads data sets from unknown sources safely.

First, the files and folders of the data set are listed and checked. Then a child process reads the files, with limits
of time and memory, since the libraries for Parquet, HDF5, videos and SQLite were not made for hostile files. A crash of
the child process is reported.
"""

from __future__ import annotations

import errno
import json
import os
import resource
import signal
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from custom_ros_tools.child_process import limit_resource
from custom_ros_tools.foreign import MAX_ENTRIES, printable

BASE_TIME_S = 30
"""Processor time that is allowed for every data set [s]."""
TIME_PER_MB_S = 10
"""Additional processor time for each MB of the data set's files [s]; videos need most of it."""
BASE_MEMORY = 1_200_000_000
"""Memory that is allowed for every data set, in addition to the program's own memory [bytes]."""
MEMORY_PER_BYTE = 10
"""Additional memory for each byte of the data set's files [bytes]."""
MAX_DEPTH = 16
"""Largest depth of nested folders."""
ANY_SIZE = "--any-size, if you know who made it"


class Tree(NamedTuple):
    """Result of checking the files and folders of a data set with `look_at`.

    Attributes:
        faults: Messages about links, pipes, sockets and devices, and about too many files or too deeply nested folders.
        size: Total size of all files [bytes].
    """

    faults: tuple[str, ...]
    size: int


class CheckLine(NamedTuple):
    """A line of output from the child process.

    Attributes:
        kind: `FAULT`, `SUMMARY` or `ERROR`.
        text: Text of the line.
    """

    kind: str
    text: str


FAULT, SUMMARY, ERROR = "fault", "summary", "error"
"""Kinds of lines. A line of the kind `ERROR` ends the check."""


def look_at(folder: Path) -> Tree:
    """Checks the number, kind and depth of all files and folders in a data set, without opening a file."""
    faults: list[str] = []
    size = count = 0
    waiting = [(folder, 0)]
    while waiting:
        place, depth = waiting.pop()
        with os.scandir(place) as entries:
            for entry in entries:
                name = printable(str(Path(entry.path).relative_to(folder)))
                count += 1
                if count > MAX_ENTRIES:
                    return Tree((f"expected at most {MAX_ENTRIES:,} files and folders, found more",), size)
                if entry.is_symlink():
                    faults.append(f"{name}: expected a file or folder, found a symbolic link")
                elif entry.is_dir():
                    waiting.append((Path(entry.path), depth + 1))
                    if depth == MAX_DEPTH:
                        return Tree((f"{name}: expected at most {MAX_DEPTH} levels of folders, found more",), size)
                elif entry.is_file():
                    size += entry.stat().st_size
                else:
                    faults.append(f"{name}: expected a file or folder, found a pipe, a socket or a device")
    return Tree(tuple(sorted(faults)), size)


def confined(task: Callable[[], Iterable[CheckLine]], size: int, any_size: bool = False) -> Iterator[CheckLine]:
    """Runs a task in a child process that cannot write to files, and yields the lines of the task.

    Args:
        task: Reads files from an unknown source, and yields lines.
        size: Total size of the files, from which the limits are computed [bytes].
        any_size: Whether processor time and memory are unlimited.

    Yields:
        The lines of the task. If the task exceeds a limit or a signal ends the process, the last line has the kind
        `ERROR`.
    """
    time_s = BASE_TIME_S + TIME_PER_MB_S * size // 1_000_000
    memory = BASE_MEMORY + MEMORY_PER_BYTE * size
    reading, writing = os.pipe()
    child = os.fork()
    if not child:
        os.close(reading)
        _run(task, writing, None if any_size else (time_s, memory))
    os.close(writing)
    try:
        with open(reading, encoding="utf-8") as lines:
            for line in lines:
                yield CheckLine(*json.loads(line))
        _, status = os.waitpid(child, 0)
        child = 0
    finally:
        if child:
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
    if os.WIFSIGNALED(status):
        number = os.WTERMSIG(status)
        over_time = f"expected at most {time_s:,} s of processor time, needs more; {ANY_SIZE}"
        ended = f"a library that reads it was ended by {signal.Signals(number).name}"
        yield CheckLine(ERROR, over_time if number in (signal.SIGXCPU, signal.SIGKILL) else ended)
    elif os.WEXITSTATUS(status) == errno.ENOMEM:
        yield CheckLine(ERROR, f"expected at most {memory / 1e9:.1f} GB of memory, needs more; {ANY_SIZE}")


def _run(task: Callable[[], Iterable[CheckLine]], writing: int, limits: tuple[int, int] | None) -> None:
    """Runs the task in this process, and then ends the process.

    Args:
        task: The task, whose lines are written as JSON.
        writing: File descriptor to which the lines are written.
        limits: Processor time [s] and memory [bytes]; None for no limits.
    """
    code = 0
    try:
        silence = os.open(os.devnull, os.O_RDWR)
        for number in (0, 1, 2):  # libraries may print content of the files there
            os.dup2(silence, number)
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))
        if limits is not None:
            limit_resource(resource.RLIMIT_CPU, limits[0], limits[0] + 5)
            resource.setrlimit(resource.RLIMIT_DATA, (_own_memory() + limits[1],) * 2)
        with open(writing, "w", encoding="utf-8") as lines:
            for line in task():
                print(json.dumps(line), file=lines, flush=True)
    except MemoryError:
        code = errno.ENOMEM
    except BrokenPipeError:
        code = errno.EPIPE
    finally:
        os._exit(code)


def _own_memory() -> int:
    """Returns the size of this process's data memory, VmData [bytes]."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmData:"):
            return int(line.split()[1]) * 1024
    return 0
