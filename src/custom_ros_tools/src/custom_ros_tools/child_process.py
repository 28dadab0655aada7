"""Child processes that end with their parent, even if it is killed, and can be killed together with their own
children."""

import contextlib
import fcntl
import os
import signal
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any


def start_child(command: Sequence[str], at_end: signal.Signals, **options: Any) -> subprocess.Popen[bytes]:
    """Starts a process that gets a signal when this one ends, for any reason.

    Its standard input is a pipe that this process holds open. When that end is closed, because this process ends or
    closes `stdin` of the returned process, the kernel sends the signal (`F_SETSIG` of fcntl(2)). `PR_SET_PDEATHSIG`
    would send it at the end of the thread that starts the child. It also needs code between fork and exec, which is not
    safe where there are threads.

    Args:
        command: The command line.
        at_end: The signal.
        options: Options of `subprocess.Popen`, except `stdin`.

    Raises:
        OSError: If it cannot be started.
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
    """Kills a process and its children, each of which leads a process group, as `roslaunch` and its nodes do."""
    for pid in (process.pid, *_children(process.pid)):
        with contextlib.suppress(ProcessLookupError):
            os.killpg(pid, signal.SIGKILL)
    process.wait()


def is_stopped(process_id: int) -> bool:
    """Returns whether a process is stopped by a signal, such as SIGSTOP; see proc_pid_stat(5)."""
    with contextlib.suppress(OSError):  # it has just ended
        return Path(f"/proc/{process_id}/stat").read_text().rpartition(")")[2].split()[0] == "T"
    return False


def _children(parent: int) -> list[int]:
    """Returns the ids of a process's children; see proc_pid_stat(5)."""
    children = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):  # it has just ended
            _, ppid, *_ = path.read_text().rpartition(")")[2].split()
            if int(ppid) == parent:
                children.append(int(path.parent.name))
    return children
