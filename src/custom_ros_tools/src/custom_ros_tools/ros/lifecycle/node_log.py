"""What a node logs, on the console and in /rosout: its packages' loggers, and last lines so that they are heard."""

from __future__ import annotations

import contextlib
import logging
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


class _RosHandler(logging.Handler):
    """Hands log records to rospy."""

    def emit(self, record: logging.LogRecord) -> None:
        levels = (
            (logging.CRITICAL, rospy.logfatal),
            (logging.ERROR, rospy.logerr),
            (logging.WARNING, rospy.logwarn),
            (logging.INFO, rospy.loginfo),
            (logging.DEBUG, rospy.logdebug),
        )
        next(send for level, send in levels if record.levelno >= level)(self.format(record))


def attach_logging(modules: Iterable[str]) -> None:
    """Attaches the loggers of top-level Python modules to /rosout; call it once, after `rospy.init_node`."""
    handler = _RosHandler(level=logging.DEBUG)
    for module in modules:
        logger = logging.getLogger(module)
        logger.setLevel(logging.INFO)
        logger.propagate = False
        logger.addHandler(handler)


def log_fatal_lines(lines: Iterable[str]) -> None:
    """Logs lines as fatal, on the console and in /rosout, just before the node ends."""
    publisher = rospy.Publisher(ROSOUT, Log, queue_size=100, latch=True)  # another handle on what rospy logs to
    end_s = time.monotonic() + LONGEST_WAIT_S
    expected = _listeners()
    while publisher.get_num_connections() < expected and time.monotonic() < end_s and not rospy.is_shutdown():
        time.sleep(0.01)
    print(file=sys.stderr)  # libraries, PyBullet for one, may leave their own last line unended
    for line in lines:
        rospy.logfatal(line)
    time.sleep(SENDING_S)


def _listeners() -> int:
    """Returns how many nodes listen to /rosout."""
    with contextlib.suppress(OSError, rosgraph.MasterException):
        subscribed = rosgraph.Master(rospy.get_name()).getSystemState()[1]
        return len(dict(subscribed).get(ROSOUT, ()))
    return 0
