"""Ends a launch whose work is done, like Ctrl-C.

roslaunch reports every end of a node with `required="true"` as `REQUIRED process has died`, in red, even if the node
exits with 0. A node that has succeeded calls `end_launch` instead. After a failure, the node exits with 1, so that the
report is true.
"""

import contextlib
import os
import signal
import threading

import rospy

from .timed_master import MASTER_FAILURES, timed_master

MAX_FAREWELL_S = 15.0
"""Time for which the node waits for roslaunch to stop it [s]; afterwards, roslaunch kills an interrupted node."""


def end_launch(reason: str) -> None:
    """Ends all nodes of the launch to which this node belongs. Without a roslaunch, ends only this node.

    Args:
        reason: Why the node ends, for its log.
    """
    left = threading.Event()
    rospy.on_shutdown(left.set)
    if not rospy.is_shutdown() and interrupt_roslaunch():
        left.wait(MAX_FAREWELL_S)
    rospy.signal_shutdown(reason)


def interrupt_roslaunch() -> bool:
    """Interrupts the `roslaunch` that started this process, like Ctrl-C. The `roslaunch` then ends all of its nodes.

    Returns:
        Whether `roslaunch` started this process.
    """
    parent = os.getppid()
    for uri in rospy.get_param("/roslaunch/uris", {}).values():
        with contextlib.suppress(*MASTER_FAILURES), timed_master(uri) as roslaunch:  # its port may be another program's
            if roslaunch.get_pid()[2] == parent:
                os.kill(parent, signal.SIGINT)
                return True
    return False
