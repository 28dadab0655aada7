"""Child processes that end when their parent does, even if that is killed."""

import fcntl
import os
import signal
import subprocess
from collections.abc import Sequence
from typing import Any


def start_child(command: Sequence[str], at_end: signal.Signals, **options: Any) -> subprocess.Popen[bytes]:
    """Starts a process that gets a signal when this one ends, in whichever way.

    Its standard input is a pipe that this process holds open. When its other end is closed, by the end of the process
    or of `stdin` of what is returned, the kernel sends the signal (`F_SETSIG` of fcntl(2)). `PR_SET_PDEATHSIG` would
    send it at the end of the thread that starts the child. It also needs code between fork and exec, which is not safe
    where there are threads.

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
