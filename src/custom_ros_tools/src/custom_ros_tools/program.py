"""Entry points of the programs of nodes and commands; importing it starts no thread."""

import os
import pkgutil
import resource
import select
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

MIN_MEMORY_BYTES = 500_000_000
"""Bytes of address space that NumPy and PyBullet need; with less, they end the process."""
PARENT_PERIOD_S = 0.5
"""Time between two checks of whether the parent process has ended [s]."""
MAX_END_S = 15.0
"""Longest time for an orderly end [s], as roslaunch gives its nodes before it sends SIGTERM."""


def is_output_closed() -> bool:
    """Returns whether the standard output is a pipe whose reader has closed it."""
    output = select.poll()
    output.register(1, 0)
    return any(event & select.POLLERR for _, event in output.poll(0))


def run(main: str) -> None:
    """Runs a node's `module:function` with SIGINT blocked for `custom_ros_tools.ros.lifecycle.run_node`.

    A signal must be blocked before the first thread starts, and libraries start threads on import; therefore the
    function is imported here. The node ends with the roslaunch that started it.
    """
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    end_with_roslaunch()
    _prepare_for_numpy()
    pkgutil.resolve_name(main)()


def run_command(main: str, call: Callable[[Any], Any] = lambda function: function()) -> None:
    """Runs a command's `module:function` and exits with its result; Ctrl-C ends it without a traceback.

    Until the function is imported, Ctrl-C ends the process at once; afterwards it raises a KeyboardInterrupt. A process
    that starts with SIGINT blocked, as by `env --block-signal=INT`, is safe before that too. In a process that ignores
    SIGINT, as behind the `&` of a script, it stays ignored. When the reader of its output has ended, as with `| head`,
    it ends as by SIGPIPE, with 141.

    Args:
        main: The function.
        call: Calls the function, and returns the exit code.
    """
    heeds = signal.getsignal(signal.SIGINT) != signal.SIG_IGN
    if heeds:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    _prepare_for_numpy()
    function = pkgutil.resolve_name(main)
    try:
        if heeds:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        try:
            code = call(function)
        finally:
            sys.stdout.flush()
        sys.exit(code)
    except KeyboardInterrupt:
        sys.exit(130)
    except BrokenPipeError:
        if not is_output_closed():
            raise
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # for output that Python writes when it exits
        sys.exit(128 + signal.SIGPIPE)
    finally:
        if heeds:  # while Python is ending, too
            signal.signal(signal.SIGINT, signal.SIG_DFL)


@contextmanager
def late_imports() -> Iterator[None]:
    """Makes Ctrl-C end the process at once while a command imports libraries in its function.

    Some libraries catch a KeyboardInterrupt in their imports, and continue or fail with a traceback.
    """
    handler = signal.getsignal(signal.SIGINT)
    if handler is not signal.default_int_handler or threading.current_thread() is not threading.main_thread():
        yield
        return
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)


def _prepare_for_numpy() -> None:
    """Limits matrix computations to one thread, unless the environment sets another number; before NumPy is imported.

    Our matrices are small. More threads would mostly wait for each other: the busier the machine, the longer; under a
    memory limit, forever. With too little memory, the program ends with 1.
    """
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    if limit != resource.RLIM_INFINITY and limit < MIN_MEMORY_BYTES:
        sys.exit(
            f"memory is limited to {limit / 1e6:.0f} MB (ulimit -v); expected at least {MIN_MEMORY_BYTES / 1e6:.0f} MB"
        )
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def end_with_roslaunch() -> None:
    """Ends this process soon after the roslaunch that started it, even if roslaunch was killed.

    Only nodes that roslaunch has started are affected; they have the argument `__log`. Other processes outlive their
    parent, such as a node in the background of a closed shell. The process ends as by Ctrl-C, or by SIGKILL if that
    takes longer than 15 s. SIGINT must be blocked already.
    """
    if any(word.startswith("__log:=") for word in sys.argv):
        threading.Thread(target=_wait_and_end, args=(os.getppid(),), name="roslaunch", daemon=True).start()


def _wait_and_end(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(PARENT_PERIOD_S)
    print("roslaunch has ended without its nodes: this one ends", file=sys.stderr, flush=True)
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(MAX_END_S)
    os.kill(os.getpid(), signal.SIGKILL)
