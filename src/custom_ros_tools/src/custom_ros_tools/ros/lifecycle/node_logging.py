"""Sends log records of Python's loggers to /rosout and the console, including the last lines before a node ends."""

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
"""Longest time to wait until the subscribers of /rosout have connected to a node that has just started [s]."""
MAX_LOOK_S = 1.0
"""Timeout of the connection that tests whether a subscriber is alive [s]."""
SENDING_S = 0.2
"""Time that rospy gets to send the last lines before the process ends [s]."""
LOG_PARAMETER = "/rosout_disable_topics_generation"
"""Parameter to which rospy subscribes when it logs the first line."""


class _RosHandler(logging.Handler):
    """Logging handler that passes log records to rospy's functions, such as `rospy.loginfo`."""

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
    """Sends the log records of top-level Python modules to /rosout. Call once, after `rospy.init_node`.

    From then on, errors that occur while writing log lines to the console are ignored.
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
    """Makes rospy drop log lines that cannot be written to the console, for example on a full disk.

    rospy itself would raise an error in the thread that logs, which could end a timer. Dropped lines are still sent to
    /rosout.
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
    """Returns False for errors of callbacks while ROS shuts down, and True for all other log records.

    During the shutdown, rospy closes topics. So callbacks that publish raise errors, which are not worth logging.
    """
    return not (rospy.core.is_shutdown_requested() and record.getMessage().startswith("bad callback"))


def log_fatal_lines(lines: Iterable[str]) -> None:
    """Logs lines with level fatal on the console and /rosout, and waits until rospy has had time to send them."""
    publisher = rospy.Publisher(ROSOUT, Log, queue_size=100, latch=True)  # shares the connections of rospy's publisher
    end_s = time.monotonic() + MAX_WAIT_S
    expected = _count_subscribers()
    while publisher.get_num_connections() < expected and time.monotonic() < end_s and not rospy.is_shutdown():
        time.sleep(0.01)
    with contextlib.suppress(OSError):  # for example on a full disk
        print(file=sys.stderr)  # libraries such as PyBullet may not have ended their last line
    for line in lines:
        rospy.logfatal(line)
    time.sleep(SENDING_S)


def _count_subscribers() -> int:
    """Returns the number of nodes that subscribe to /rosout and accept connections; 0 if the master is unreachable."""
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
