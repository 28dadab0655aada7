"""What the nodes of solvers have in common: their names, and how problems are published."""

import sys
import threading
from collections.abc import Callable

import rospy

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning, WallTimer
from custom_ros_tools.ros.services import ToggleService
from custom_ros_tools.toggle import Toggle
from ik_ros.solvers import SOLVERS

QUEUE_SIZE = 10


def topics_of(kind: str, name: str) -> str:
    """Returns the prefix of the topics and services of a solver's node, `setup` or `solver`."""
    return f"ik/{kind}/{name.replace(':', '/').replace('.', '/')}"


def publish_problems(
    topics: str, message_type: type, hz: float, start_on_init: bool, problem: Callable[[], rospy.Message]
) -> None:
    """Publishes problems on the topic `ik`, from now on and while it is switched on.

    Args:
        topics: Prefix of the service `toggle`, which switches it.
        message_type: Type of the problems.
        hz: The rate, in wall time [Hz].
        start_on_init: Whether it is on from the start.
        problem: Returns the next one; if there is none, it raises an `InterfaceError` or `ValueError` that says why.
    """
    is_on, warn = threading.Event(), ThrottledWarning()
    publisher = rospy.Publisher("ik", message_type, queue_size=QUEUE_SIZE, tcp_nodelay=True)

    def publish() -> None:
        if not is_on.is_set():
            return
        try:
            publisher.publish(problem())
        except (InterfaceError, ValueError) as error:
            warn("no problem is published", str(error))

    setup = Toggle("setup", is_on.set, is_on.clear)
    if start_on_init:
        setup.on()
    ToggleService(f"{topics}/toggle", setup.on, setup.off)
    WallTimer(hz, publish)


def run_for_solver(kind: str, make: Callable[[str], object]) -> None:
    """Runs a node whose command line names the solver; without a name, it ends the program with 2.

    Args:
        kind: `setup` or `solver`.
        make: Makes the node for the solver of a name.
    """
    arguments = rospy.myargv(sys.argv)[1:]
    if len(arguments) != 1:
        print(f"usage: ik_{kind}_node.py SOLVER, out of {', '.join(SOLVERS)}, or module:Class", file=sys.stderr)
        sys.exit(2)
    (name,) = arguments
    run_node(f"ik_{kind}_{name.rpartition(':')[2]}", lambda: make(name), anonymous=True, loggers=["rpbi"])
