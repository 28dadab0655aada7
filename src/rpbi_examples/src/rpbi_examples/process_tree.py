"""Ends programs that do not end by themselves, together with what they started."""

import contextlib
import os
import signal
import subprocess
from pathlib import Path


def kill_with_children(process: subprocess.Popen) -> None:
    """Kills a process and its children, each of which leads a process group, as `roslaunch` and its nodes do."""
    for pid in (process.pid, *_children(process.pid)):
        with contextlib.suppress(ProcessLookupError):
            os.killpg(pid, signal.SIGKILL)
    process.wait()


def _children(parent: int) -> list[int]:
    """Returns the ids of a process's children; see proc_pid_stat(5)."""
    children = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):  # it has just ended
            _, ppid, *_ = path.read_text().rpartition(")")[2].split()
            if int(ppid) == parent:
                children.append(int(path.parent.name))
    return children
