"""Commands, start, limits and end of child processes: they end with their parent, and together with all children."""

import contextlib
import fcntl
import os
import resource
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

_WITHOUT_FOLDER = "import runpy, sys; del sys.path[0]; runpy.run_module(sys.argv.pop(1), None, '__main__', True)"
"""Runs the module that the first argument names."""


def python_module(name: str, *words: str) -> list[str]:
    """Returns the command that runs a module by this Python; files of the current folder hide no module.

    Args:
        name: Full name of the module.
        words: Arguments of the module.
    """
    start = ["-P", "-m"] if sys.version_info >= (3, 11) else ["-c", _WITHOUT_FOLDER]
    return [sys.executable, *start, name, *words]


def limit_resource(kind: int, soft: int, hard: int | None = None) -> None:
    """Sets limits of this process. Limits that are lower already, such as those of `ulimit -t`, are kept.

    Args:
        kind: Constant of `resource`, such as `resource.RLIMIT_CPU`.
        soft: Soft limit.
        hard: Hard limit. None: the soft limit.
    """
    limits = (soft, soft if hard is None else hard)
    present = resource.getrlimit(kind)
    kept = (old if old != resource.RLIM_INFINITY and old < new else new for old, new in zip(present, limits))
    lowest_soft, lowest_hard = kept
    resource.setrlimit(kind, (min(lowest_soft, lowest_hard), lowest_hard))


def start_child(command: Sequence[str], at_end: signal.Signals, **options: Any) -> subprocess.Popen[bytes]:
    """Starts a child process that gets a signal when this process ends, even if this process is killed.

    The child's standard input is a pipe that this process holds open. The kernel sends the signal when this process
    ends, or closes `stdin` of the returned process (`F_SETSIG` of fcntl(2)). The alternative `PR_SET_PDEATHSIG` would
    send the signal as soon as the thread that started the child ends. It would also need code between fork and exec,
    which is unsafe in a process with several threads.

    Args:
        command: Program and arguments of the child.
        at_end: The signal that the child gets.
        options: Options of `subprocess.Popen`, except `stdin`.

    Raises:
        OSError: If the process cannot be started.
    """
    reading, writing = os.pipe()
    try:
        process = subprocess.Popen(command, stdin=reading, **options)
        fcntl.fcntl(reading, fcntl.F_SETOWN, process.pid)
        fcntl.fcntl(reading, fcntl.F_SETSIG, at_end)
        fcntl.fcntl(reading, fcntl.F_SETFL, os.O_ASYNC)
    except BaseException:
        os.close(writing)
        raise
    finally:
        os.close(reading)
    process.stdin = open(writing, "wb", buffering=0)
    return process


def kill_with_children(process: subprocess.Popen) -> None:
    """Kills the process groups of a process and of its children, and waits for the end of the process.

    The process and each child must be the leaders of separate process groups, like `roslaunch` and its nodes.
    """
    for pid in (process.pid, *_children(process.pid)):
        with contextlib.suppress(ProcessLookupError):
            os.killpg(pid, signal.SIGKILL)
    process.wait()


def is_stopped(process_id: int) -> bool:
    """Returns whether a process is suspended by a signal, such as SIGSTOP; see proc_pid_stat(5)."""
    with contextlib.suppress(OSError):  # the process has just ended
        return Path(f"/proc/{process_id}/stat").read_text().rpartition(")")[2].split()[0] == "T"
    return False


def _children(parent: int) -> list[int]:
    """Returns the process ids of a process's children; see proc_pid_stat(5)."""
    children = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):  # the process has just ended
            _, ppid, *_ = path.read_text().rpartition(")")[2].split()
            if int(ppid) == parent:
                children.append(int(path.parent.name))
    return children
