"""What a node says just before it ends, so that it is heard."""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Iterable

import rosgraph
import rospy
from rosgraph_msgs.msg import Log

ROSOUT = "/rosout"
LONGEST_WAIT_S = 2.0
"""How long to wait for those who listen to /rosout; a node that has just begun is not connected to them yet."""
SENDING_S = 0.2


def log_fatal_lines(lines: Iterable[str]) -> None:
    """Logs lines as fatal, on the console and in /rosout.

    Args:
        lines: What to say.
    """
    publisher = rospy.Publisher(ROSOUT, Log, queue_size=100, latch=True)  # another handle on what rospy logs to
    end_s = time.monotonic() + LONGEST_WAIT_S
    expected = _listeners()
    while publisher.get_num_connections() < expected and time.monotonic() < end_s and not rospy.is_shutdown():
        time.sleep(0.01)
    print(file=sys.stderr)  # libraries, PyBullet for one, may leave their own last line unended
    for line in lines:
        rospy.logfatal(line)
    time.sleep(SENDING_S)


def log_loss_of_master(error: ConnectionError) -> None:
    """Logs that the ROS master has gone while it was needed.

    Args:
        error: What the call to it raised.
    """
    log_fatal_lines([f"the ROS master at {rosgraph.get_master_uri()} has gone while the node was starting: {error}"])


def _listeners() -> int:
    """Returns how many nodes listen to /rosout."""
    with contextlib.suppress(OSError, rosgraph.MasterException):
        subscribed = rosgraph.Master(rospy.get_name()).getSystemState()[1]
        return len(dict(subscribed).get(ROSOUT, ()))
    return 0
