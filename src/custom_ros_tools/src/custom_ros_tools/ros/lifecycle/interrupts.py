"""Ctrl-C at any moment, without hanging and without a traceback.

rospy would shut down inside the signal handler, wherever the program happens to be. If that is inside a lock that the
shutdown needs too, the process hangs for good; and also if anybody opens or closes a topic meanwhile. So here SIGINT
stays blocked, and is waited for where it is safe to act on it. It has to be blocked before the process starts its first
thread, and `rospy.init_node` be called with `disable_signals`. Child processes inherit the block, which leaves their
end to this process.
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import rosgraph
import rospy

LONGEST_FAREWELL_S = 10.0
"""How long leaving the ROS master may take [s]; it may hang or be gone."""
MASTER_PERIOD_S = 0.2


def wait_for_master() -> bool:
    """Waits until there is a ROS master; from here on, SIGTERM does the same as SIGINT.

    Returns:
        False if it was interrupted.
    """
    signal.signal(signal.SIGTERM, lambda *_: _interrupt())
    told = False
    while not rosgraph.is_master_online():
        if not told:
            print(f"waiting for a ROS master at {rosgraph.get_master_uri()}: is roscore running?", flush=True)
            told = True
        if signal.sigtimedwait({signal.SIGINT}, MASTER_PERIOD_S) is not None:
            return False
    return True


@contextmanager
def leaving_ros_on_interrupt() -> Iterator[None]:
    """Shuts ROS down on SIGINT, and in any case when the block ends, in a thread of its own."""
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
