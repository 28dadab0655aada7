"""What the programs of nodes and commands call; it imports nothing that starts a thread."""

import os
import pkgutil
import resource
import signal
import sys

LEAST_MEMORY = 500_000_000
"""Bytes of address space that NumPy and PyBullet need; with less, they end the process."""


def run(main: str) -> None:
    """Runs a node's `module:function` with Ctrl-C held back for `custom_ros_tools.ros.lifecycle.run_node`.

    A signal can be held back only before the process has its first thread, and libraries start theirs when they are
    imported; so the function is imported here.
    """
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    _prepare_for_numpy()
    pkgutil.resolve_name(main)()


def run_command(main: str) -> None:
    """Runs a command's `module:function` and exits with what it returns; Ctrl-C ends it without a traceback.

    Until the function is imported, Ctrl-C ends the process at once, from then on it is a KeyboardInterrupt. Who starts
    the process with SIGINT blocked, as `env --block-signal=INT` does, leaves no moment before that either. In a process
    that ignores SIGINT, as behind the `&` of a script, it stays ignored.
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
        sys.exit(function())
    except KeyboardInterrupt:
        sys.exit(130)
    finally:
        if heeds:  # while Python is leaving, too
            signal.signal(signal.SIGINT, signal.SIG_DFL)


def _prepare_for_numpy() -> None:
    """Has matrices computed in one thread, unless the environment says otherwise; before NumPy is imported.

    Ours are small, so further threads would do little but wait for each other, which costs more the busier the machine
    is, and under a limit of memory for ever. Where memory is limited to too little, the program ends with 1.
    """
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    if limit != resource.RLIM_INFINITY and limit < LEAST_MEMORY:
        sys.exit(
            f"memory is limited to {limit / 1e6:.0f} MB (ulimit -v); expected at least {LEAST_MEMORY / 1e6:.0f} MB"
        )
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
