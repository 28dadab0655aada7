"""The topic `ik` of setup nodes, which are switched on and off."""

import threading
from collections.abc import Callable

import rospy

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning, WallTimer
from custom_ros_tools.ros.services import ToggleService
from custom_ros_tools.toggle import Toggle

from .solver_watch import SolverWatch

QUEUE_SIZE = 10
START_TOPICS = ("qinit", "start_state", "currentPosition")
"""Names that the release's solvers have for the same."""
PREVIOUS_TOPICS = ("previous_solutions", "previous_solution")


def publish_problems(
    topics: str,
    message_type: type,
    hz: float,
    start_on_init: bool,
    problem: Callable[[], rospy.Message | None],
    has_solver_node: bool = True,
) -> None:
    """Publishes problems on the topic `ik`, from now on and while it is switched on.

    Args:
        topics: Prefix of the service `toggle`, which switches it.
        message_type: Type of the problems.
        hz: The rate, in wall time [Hz].
        start_on_init: Whether it is on from the start.
        problem: Returns the next one; without one it returns None, or raises an `InterfaceError` or `ValueError` with
            the reason.
        has_solver_node: Whether a node is to answer on `ik/solution`, which is watched then.
    """
    is_on, warn = threading.Event(), ThrottledWarning()
    publisher = rospy.Publisher("ik", message_type, queue_size=QUEUE_SIZE, tcp_nodelay=True)
    watch = SolverWatch(publisher) if has_solver_node else None

    def publish() -> None:
        if not is_on.is_set():
            return
        try:
            if (message := problem()) is not None:
                publisher.publish(message)
                if watch is not None:
                    watch.note_problem()
        except (InterfaceError, ValueError) as error:
            warn("no problem is published", str(error))

    setup = Toggle("setup", is_on.set, is_on.clear)
    if start_on_init:
        setup.on()
    ToggleService(f"{topics}/toggle", setup.on, setup.off)
    WallTimer(hz, publish)
