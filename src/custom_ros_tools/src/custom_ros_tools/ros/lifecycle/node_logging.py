"""Log records of a node: from Python's loggers to /rosout and the console, and the last lines before it ends."""

import contextlib
import logging
import socket
import sys
import time
from collections.abc import Callable, Iterable

import rosgraph
import rospy
from rosgraph.roslogging import RosStreamHandler
from rosgraph_msgs.msg import Log

ROSOUT = "/rosout"
ROSPY_LOGGER = "rosout"
MAX_WAIT_S = 10.0
"""Longest time to wait for subscribers of /rosout [s]; a node that has just started is not connected to them yet."""
MAX_LOOK_S = 1.0
"""Longest time for connecting to a subscriber, to see whether it lives [s]."""
SENDING_S = 0.2
"""Time for rospy to send the last lines [s]; it drops unsent lines when the process ends."""
LOG_PARAMETER = "/rosout_disable_topics_generation"
"""Parameter to which rospy subscribes with the first line that it logs."""


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
    """Attaches the loggers of top-level Python modules to /rosout; call it once, after `rospy.init_node`.

    From then on, a console that cannot be written raises no error.
    """
    handler = _RosHandler(level=logging.DEBUG)
    for module in modules:
        logger = logging.getLogger(module)
        logger.setLevel(logging.INFO)
        logger.propagate = False
        logger.addHandler(handler)
    logging.getLogger(ROSPY_LOGGER).addFilter(_is_news)
    _keep_console_from_raising()


def _keep_console_from_raising() -> None:
    """Drops log lines that cannot be written to the console, for instance on a full disk; /rosout still gets them.

    rospy would raise in the thread that logs, and so end a timer, for instance.
    """
    for handler in logging.getLogger(ROSPY_LOGGER).handlers:
        if isinstance(handler, RosStreamHandler):
            handler.emit = _dropping_what_cannot_be_written(handler.emit)


def _dropping_what_cannot_be_written(emit: Callable[[logging.LogRecord], None]) -> Callable[[logging.LogRecord], None]:
    def call(record: logging.LogRecord) -> None:
        with contextlib.suppress(OSError):
            emit(record)

    return call


def _is_news(record: logging.LogRecord) -> bool:
    """Returns whether a message of rospy is logged; errors of callbacks that publish on a topic closed by the shutdown
    are not.

    rospy closes topics first, and only then recognises exceptions of callbacks as a consequence.
    """
    return not (rospy.core.is_shutdown_requested() and record.getMessage().startswith("bad callback"))


def log_fatal_lines(lines: Iterable[str]) -> None:
    """Logs lines as fatal, on the console and in /rosout, just before the node ends."""
    publisher = rospy.Publisher(ROSOUT, Log, queue_size=100, latch=True)  # another handle on rospy's log
    end_s = time.monotonic() + MAX_WAIT_S
    expected = _count_subscribers()
    while publisher.get_num_connections() < expected and time.monotonic() < end_s and not rospy.is_shutdown():
        time.sleep(0.01)
    with contextlib.suppress(OSError):  # of a full disk
        print(file=sys.stderr)  # libraries, PyBullet for one, may leave their own last line unended
    for line in lines:
        rospy.logfatal(line)
    time.sleep(SENDING_S)


def _count_subscribers() -> int:
    """Returns the number of nodes that subscribe to /rosout, according to the master; killed ones may be among them."""
    with contextlib.suppress(OSError, rosgraph.MasterException):
        master = rosgraph.Master(rospy.get_name())
        nodes = dict(master.getSystemState()[1]).get(ROSOUT, ())
        return sum(map(_accepts_connections, map(master.lookupNode, nodes)))
    return 0


def _accepts_connections(uri: str) -> bool:
    with contextlib.suppress(OSError, ValueError):
        socket.create_connection(rosgraph.network.parse_http_host_and_port(uri), MAX_LOOK_S).close()
        return True
    return False
