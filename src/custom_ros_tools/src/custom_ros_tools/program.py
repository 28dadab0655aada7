"""Entry points for the programs of nodes and commands. Importing this module does not start threads."""

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
"""Address space that NumPy and PyBullet need [bytes]. With less address space, the libraries would end the process."""
PARENT_PERIOD_S = 0.5
"""Time between two checks of whether the parent process has ended [s]."""
MAX_END_S = 15.0
"""Time between SIGINT and SIGKILL to a process [s]. roslaunch waits as long between SIGINT and SIGTERM."""


def is_output_closed() -> bool:
    """Returns whether the standard output is a pipe that has no reader any more."""
    output = select.poll()
    output.register(1, 0)
    return any(event & select.POLLERR for _, event in output.poll(0))


def run(main: str) -> None:
    """Imports and runs the main function of a node, with SIGINT blocked as `run_node` needs it.

    SIGINT must be blocked before the first thread starts. Libraries start threads on import, so the main function is
    imported after SIGINT is blocked. The node ends when the roslaunch that started the node ends.

    Args:
        main: The main function, as `module:function`.
    """
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    end_with_roslaunch()
    _prepare_for_numpy()
    pkgutil.resolve_name(main)()


def run_command(main: str, call: Callable[[Any], Any] = lambda function: function()) -> None:
    """Imports and runs the function of a command, and exits with its result.

    Ctrl-C ends the command without a traceback, with exit code 130. During imports, Ctrl-C ends the process at once;
    afterwards, Ctrl-C raises a KeyboardInterrupt. A parent may start the process with SIGINT blocked, which delays
    Ctrl-C until this function runs. If SIGINT is ignored, as for background jobs of a script, it stays ignored. If the
    reader of the output has ended, as with `| head`, the exit code is 141, as after SIGPIPE.

    Args:
        main: The function, as `module:function`.
        call: Function that calls the imported function, and returns the exit code.
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
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # Python still flushes its output when it exits
        sys.exit(128 + signal.SIGPIPE)
    finally:
        if heeds:  # Ctrl-C also ends Python's own shutdown
            signal.signal(signal.SIGINT, signal.SIG_DFL)


@contextmanager
def late_imports() -> Iterator[None]:
    """Makes Ctrl-C end the process at once, within a context in which a command imports libraries.

    Without the context, libraries may catch the KeyboardInterrupt during import and continue, or print a traceback.
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
    """Limits NumPy's matrix computations to one thread, and exits with 1 if the memory limit is too low for NumPy.

    Must be called before NumPy is imported. If the environment sets a number of threads, this number is kept. The
    matrices of this workspace are small, so that several threads would mostly wait for each other. Under a memory
    limit, several threads would wait forever.
    """
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    if limit != resource.RLIM_INFINITY and limit < MIN_MEMORY_BYTES:
        sys.exit(
            f"memory is limited to {limit / 1e6:.0f} MB (ulimit -v); expected at least {MIN_MEMORY_BYTES / 1e6:.0f} MB"
        )
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def end_with_roslaunch() -> None:
    """Starts a thread that ends this process soon after roslaunch has ended, even if roslaunch was killed.

    The thread sends SIGINT, and after 15 s SIGKILL. It is only started in nodes that roslaunch has started, which have
    an argument `__log`. Other processes, such as a node in the background of a closed shell, continue after the end of
    their parent. SIGINT must be blocked before this function is called.
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
