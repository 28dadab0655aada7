"""Starts and runs a node that Ctrl-C can end at any time, without a hang or traceback.

rospy itself shuts down inside the signal handler, at any point of the program. The process may hang forever if the
interrupted code holds a lock that the shutdown needs, or if a thread opens or closes a topic at the same time.
Therefore, SIGINT stays blocked (see `custom_ros_tools.program`), and a thread waits for the signal. In child processes,
SIGINT is blocked as well, so this process has to end its children.
"""

import atexit
import contextlib
import os
import resource
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from typing import TypeVar

import rosgraph
import rospy

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.rospy_internals import keep_accepting, keep_new_connections

from .master_watch import MasterWatch
from .node_logging import LOG_PARAMETER, attach_logging, log_fatal_lines
from .timed_master import address_fault, allow_large_integers

T = TypeVar("T")

MAX_FAREWELL_S = 10.0
"""Longest time to wait for unregistering from the ROS master, which may hang or have ended [s]."""
MASTER_PERIOD_S = 0.2
INTERRUPTED_TOO_S = 1.0
"""Time to wait for an interrupt after a failed service call [s], since Ctrl-C may end the server before this node."""
MAX_FILES = 8192


def init_node(name: str, loggers: Iterable[str] = (), anonymous: bool = False, ros_time: bool = True) -> None:
    """Initialises a node that registers again at a restarted ROS master; for the arguments, see `run_node`."""
    keep_accepting()
    keep_new_connections()
    allow_large_integers()
    rospy.init_node(name, anonymous=anonymous, disable_rostime=not ros_time, disable_signals=True)
    rospy.on_shutdown(_leave_parameters)
    attach_logging({"custom_ros_tools", *loggers})
    _allow_many_files()
    MasterWatch()
    if fault := address_fault():
        rospy.logwarn(fault)


def run_node(
    name: str,
    start: Callable[[], T],
    run: Callable[[T], object] | None = None,
    *,
    anonymous: bool = False,
    ros_time: bool = True,
    loggers: Iterable[str] = (),
) -> None:
    """Runs a node until an interrupt. After an error, such as an invalid configuration, exits with code 1.

    The program must have been started with `custom_ros_tools.program.run`, which blocks SIGINT.

    Args:
        name: Default name of the node.
        start: Function that opens topics and services. It may also do the node's work until ROS shuts down, and may
            raise `rospy.ROSInterruptException`. The returned object is kept until the node ends.
        run: Function that does the node's work until ROS shuts down, with the object that `start` returned. If `run` is
            given, an interrupt takes effect only after `start` has returned.
        anonymous: Whether ROS makes the name unique by a suffix.
        ros_time: Whether the node uses ROS time. If False, the node never waits for /clock.
        loggers: Top-level Python modules whose log records go to /rosout, in addition to the module of `start`.
    """
    if not _wait_for_master():
        return
    init_node(name, (start.__module__.partition(".")[0], *loggers), anonymous, ros_time)
    ended = threading.Event()
    rospy.on_shutdown(ended.set)
    with ExitStack() as stack:
        try:
            if run is None:
                stack.enter_context(_leaving_ros_on_interrupt())
            node = start()
            if run is not None:
                stack.enter_context(_leaving_ros_on_interrupt())
                run(node)
            ended.wait()
        except InterfaceError as error:
            log_fatal_lines(str(error).splitlines())
            sys.exit(1)
        except ConnectionError as error:
            uri = rosgraph.get_master_uri()
            log_fatal_lines([f"the ROS master at {uri} has gone while the node was starting: {error}"])
            sys.exit(1)
        except rospy.ServiceException as error:
            if not ended.wait(INTERRUPTED_TOO_S) and not rospy.core.is_shutdown_requested():
                log_fatal_lines([f"{error}: its node has gone, or cannot be reached"])
                sys.exit(1)
        except MemoryError as error:
            log_fatal_lines([f"out of memory: {error or 'is there a limit, such as ulimit -v?'}"])
            sys.exit(1)
        except rospy.ROSInterruptException:
            return
        except rospy.ROSException:
            if not rospy.core.is_shutdown_requested():  # otherwise the node was publishing when its topics closed
                raise


def _wait_for_master() -> bool:
    """Waits for a ROS master. Returns True when a master is reachable, or False after an interrupt.

    Also makes SIGTERM act like SIGINT.
    """
    signal.signal(signal.SIGTERM, lambda *_: _interrupt())
    is_reported = False
    while not rosgraph.is_master_online():
        if not is_reported:
            print(f"waiting for a ROS master at {rosgraph.get_master_uri()}: is roscore running?", flush=True)
            is_reported = True
        if signal.sigtimedwait({signal.SIGINT}, MASTER_PERIOD_S) is not None:
            return False
    return True


@contextmanager
def _leaving_ros_on_interrupt() -> Iterator[None]:
    """Shuts ROS down in a separate thread, either on SIGINT or when the context ends."""
    thread = threading.Thread(target=_wait_and_leave, name="interrupts", daemon=True)
    thread.start()
    try:
        yield
    finally:
        _interrupt()
        thread.join(MAX_FAREWELL_S)


def leave_ros_on_signals() -> None:
    """Makes SIGINT and SIGTERM shut ROS down in a separate thread, for scripts that do not use `run_node`.

    Call this function in the main thread, after `rospy.init_node(..., disable_signals=True)`.
    """
    rospy.on_shutdown(_leave_parameters)
    reading, writing = os.pipe()

    def wait_and_leave() -> None:
        os.read(reading, 1)
        rospy.signal_shutdown("interrupted, or at its end")

    def leave() -> None:
        os.write(writing, b".")
        thread.join(MAX_FAREWELL_S)

    thread = threading.Thread(target=wait_and_leave, name="interrupts", daemon=True)
    thread.start()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: os.write(writing, b"."))  # safe at any point of the script
    atexit.register(leave)


def _leave_parameters() -> None:
    """Unsubscribes from the parameter `LOG_PARAMETER`, which rospy itself does not do.

    If the subscription were kept, and another node used the same name later, the master would try to shut down this
    node, and would shut down a node that has got this node's address in the meantime.
    """
    with contextlib.suppress(OSError, rosgraph.MasterException):
        rosgraph.Master(rospy.get_name()).unsubscribeParam(rospy.get_node_uri(), LOG_PARAMETER)


def _interrupt() -> None:
    os.kill(os.getpid(), signal.SIGINT)


def _wait_and_leave() -> None:
    signal.sigwait({signal.SIGINT})
    rospy.signal_shutdown("interrupted, or at its end")


def _allow_many_files() -> None:
    """Raises the process's limit of open files to `MAX_FILES`, if allowed, since each topic connection needs a file."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    most = MAX_FILES if hard == resource.RLIM_INFINITY else min(hard, MAX_FILES)
    if soft != resource.RLIM_INFINITY and soft < most:
        resource.setrlimit(resource.RLIMIT_NOFILE, (most, hard))
