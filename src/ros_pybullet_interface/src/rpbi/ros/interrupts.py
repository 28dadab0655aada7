"""Ctrl-C at any moment, without hanging and without a traceback."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import rospy

LONGEST_FAREWELL_S = 10.0
"""How long leaving the ROS master may take [s]; it may hang or be gone."""


@contextmanager
def leaving_ros_on_interrupt() -> Iterator[None]:
    """Shuts ROS down on SIGINT and SIGTERM, and in any case when the block ends, from a thread of its own.

    rospy itself would do it inside the signal handler, wherever the program happens to be: if that is inside a lock
    that the shutdown needs too, the process hangs for good.

    SIGINT has to be blocked before the process starts its first thread, and `rospy.init_node` called with
    `disable_signals`. Child processes inherit the block, so that Ctrl-C leaves them to the simulator.
    """
    signal.signal(signal.SIGTERM, lambda *_: _interrupt())
    thread = threading.Thread(target=_wait_and_leave, name="interrupts", daemon=True)
    thread.start()
    try:
        yield
    finally:
        _interrupt()
        thread.join(LONGEST_FAREWELL_S)


def _interrupt() -> None:
    os.kill(os.getpid(), signal.SIGINT)


def _wait_and_leave() -> None:
    signal.sigwait({signal.SIGINT})
    rospy.signal_shutdown("interrupted, or at its end")
