"""The life of a small node: start, wait, end."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable

import rospy

from custom_ros_tools.errors import InterfaceError

from .fatal_log import log_fatal_lines, log_loss_of_master
from .interrupts import leaving_ros_on_interrupt, wait_for_master
from .logging_bridge import attach_logging
from .master_watch import MasterWatch


def run_node(name: str, start: Callable[[], object], anonymous: bool = False) -> None:
    """Runs a node until it is interrupted; what is wrong with its configuration ends it with 1.

    SIGINT has to be blocked when the process starts; see `interrupts`.

    Args:
        name: The node's name unless it is given another one.
        start: Opens topics and services, and perhaps does the node's work itself until ROS shuts down, which
            `rospy.ROSInterruptException` may tell; what it returns lives as long as the node.
        anonymous: Whether the name is made unique.
    """
    if not wait_for_master():
        return
    rospy.init_node(name, anonymous=anonymous, disable_signals=True)
    attach_logging()
    MasterWatch()
    ended = threading.Event()
    rospy.on_shutdown(ended.set)
    with leaving_ros_on_interrupt():
        try:
            _node = start()
        except InterfaceError as error:
            log_fatal_lines(str(error).splitlines())
            sys.exit(1)
        except ConnectionError as error:
            log_loss_of_master(error)
            sys.exit(1)
        except rospy.ROSInterruptException:
            return
        ended.wait()
