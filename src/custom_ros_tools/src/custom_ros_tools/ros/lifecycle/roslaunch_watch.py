"""The end of a node whose roslaunch was killed; importing it starts no thread."""

import os
import signal
import sys
import threading
import time

PERIOD_S = 0.5
"""Time between two checks of the parent [s]."""
MAX_END_S = 15.0
"""Longest time for an orderly end [s], as roslaunch gives its nodes before it sends SIGTERM."""


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
        time.sleep(PERIOD_S)
    print("roslaunch has ended without its nodes: this one ends", file=sys.stderr, flush=True)
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(MAX_END_S)
    os.kill(os.getpid(), signal.SIGKILL)
