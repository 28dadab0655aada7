"""Topics of setup nodes: the parts of a problem in, problems out, and a watchdog for the solver."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from functools import partial

import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning, WallTimer
from custom_ros_tools.ros.services import Toggle, ToggleService
from ik_ros.problem import JointPositions

from .messages import positions_in

QUEUE_SIZE = 10
START_TOPICS = ("qinit", "start_state", "currentPosition")
"""Names of solvers in the authors' release."""
PREVIOUS_TOPICS = ("previous_solutions", "previous_solution")
LOOK_HZ = 1.0
SILENT_AFTER_S = 5.0
"""Longest time without a solution while problems are published [s]; beyond it, the solver is reported."""


class ProblemInputs:
    """Start and previous solutions of the next problem, received by topics.

    Args:
        topics: Prefix of the topics.
        max_previous: Number of previous solutions that are kept.
        start: Start until one is received; None if the problem waits for it.

    Attributes:
        lock: Held while a message changes the next problem.
        start: Positions by joint [rad or m].
        previous: The same of previous solutions, the newest last.
    """

    def __init__(self, topics: str, max_previous: int, start: JointPositions | None) -> None:
        self.lock = threading.Lock()
        self.start = start
        self.previous: deque[JointPositions] = deque(maxlen=max_previous)
        self._topics, self._warn = topics, ThrottledWarning()

    def subscribe(self) -> None:
        """Receives starts and previous solutions from now on."""
        for topic in START_TOPICS:
            self.listen(topic, JointState, partial(self._on_start, topic))
        for topic in PREVIOUS_TOPICS:
            self.listen(topic, JointState, partial(self._on_previous, topic))

    def listen(self, topic: str, message_type: type, on_message: Callable[[rospy.Message], None]) -> None:
        """Calls a function with each message of a topic below the prefix; its ValueError is logged."""
        full_name = f"{self._topics}/{topic}"

        def checked(message: rospy.Message) -> None:
            try:
                with self.lock:
                    on_message(message)
            except ValueError as error:
                self._warn(rospy.resolve_name(full_name), f"message refused: {error}")

        rospy.Subscriber(full_name, message_type, checked, queue_size=QUEUE_SIZE, tcp_nodelay=True)

    def _on_start(self, topic: str, message: JointState) -> None:
        self.start = positions_in(topic, message)

    def _on_previous(self, topic: str, message: JointState) -> None:
        self.previous.append(positions_in(topic, message))


def publish_problems(
    topics: str,
    message_type: type,
    hz: float,
    start_on_init: bool,
    problem: Callable[[], rospy.Message | None],
    has_solver_node: bool = True,
) -> None:
    """Publishes problems on the topic `ik` while switched on.

    Args:
        topics: Prefix of the service `toggle`, which switches it.
        message_type: Type of the problems.
        hz: The rate, in wall time [Hz].
        start_on_init: Whether it is on from the start.
        problem: Returns the next one; without one it returns None, or raises an `InterfaceError` or `ValueError` with
            the reason.
        has_solver_node: Whether to watch for answers of a solver node on `ik/solution`.
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


class SolverWatch:
    """Reports a solver that has ended or does not answer, by a warning and in /diagnostics.

    Args:
        problems: Publisher of the problems.
    """

    def __init__(self, problems: rospy.Publisher) -> None:
        self._problems = problems
        self._lock = threading.Lock()
        self._solver = ""
        self._asked_s: float | None = None
        """Time of the first problem after the newest solution, None if there is no such problem."""
        self._fault = ""
        self._diagnostics = rospy.Publisher("/diagnostics", DiagnosticArray, queue_size=10)
        rospy.Subscriber("ik/solution", rospy.AnyMsg, self._on_solution, queue_size=1)
        WallTimer(LOOK_HZ, self._look)

    def note_problem(self) -> None:
        """Notes that a problem was published."""
        with self._lock:
            if self._asked_s is None:
                self._asked_s = time.monotonic()

    def _on_solution(self, message: rospy.AnyMsg) -> None:
        with self._lock:
            self._solver, self._asked_s = message._connection_header["callerid"], None

    def _look(self) -> None:
        fault = self._find_fault()
        if fault and not self._fault:
            rospy.logwarn("%s", fault)
        elif self._fault and not fault:
            rospy.logwarn("%s answers again", self._solver)
        self._fault = fault
        level = DiagnosticStatus.WARN if fault else DiagnosticStatus.OK
        status = DiagnosticStatus(level, f"{rospy.get_name()}: solver", fault or self._solver, "ik_ros", [])
        self._diagnostics.publish(DiagnosticArray(Header(stamp=rospy.Time.now()), [status]))

    def _find_fault(self) -> str:
        topic = self._problems.resolved_name
        with self._lock:
            solver, asked_s = self._solver, self._asked_s
        if solver and not self._problems.get_num_connections():
            return f"{solver} has ended or is switched off: no node subscribes to {topic}"
        if asked_s is None or not self._problems.get_num_connections() or time.monotonic() - asked_s < SILENT_AFTER_S:
            return ""
        return f"{solver or 'the solver'} is stopped or hangs: no solution of {topic} for {SILENT_AFTER_S:g} s"
