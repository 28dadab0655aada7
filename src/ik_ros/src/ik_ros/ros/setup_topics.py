"""Topics of setup nodes: receives start positions and previous solutions, publishes problems, monitors the solver."""

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
"""Topics on which start positions are received; each is the name that a solver of the original package uses."""
PREVIOUS_TOPICS = ("previous_solutions", "previous_solution")
LOOK_HZ = 1.0
SILENT_AFTER_S = 5.0
"""Time without a solution, while problems are published, after which the solver is reported as stopped [s]."""


class ProblemInputs:
    """Receives start positions and previous solutions for the next problem from topics.

    Args:
        topics: Prefix of the topic names.
        max_previous: Largest number of previous solutions that are kept.
        start: Start positions before the first message. None: problems have to wait for the first message.

    Attributes:
        lock: Lock that is held while a message is processed.
        start: Start positions by joint name [rad or m]; None while problems have to wait.
        previous: Previous solutions as positions by joint name [rad or m], the newest last.
    """

    def __init__(self, topics: str, max_previous: int, start: JointPositions | None) -> None:
        self.lock = threading.Lock()
        self.start = start
        self.previous: deque[JointPositions] = deque(maxlen=max_previous)
        self._topics, self._warn = topics, ThrottledWarning()

    def subscribe(self) -> None:
        """Subscribes to the topics of start positions and previous solutions."""
        for topic in START_TOPICS:
            self.listen(topic, JointState, partial(self._on_start, topic))
        for topic in PREVIOUS_TOPICS:
            self.listen(topic, JointState, partial(self._on_previous, topic))

    def listen(self, topic: str, message_type: type, on_message: Callable[[rospy.Message], None]) -> None:
        """Subscribes to a topic.

        Args:
            topic: Name of the topic, below the prefix.
            message_type: Type of the messages.
            on_message: Function that is called with each message. If it raises a ValueError, a warning is logged.
        """
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
    """Starts a timer that publishes problems on the topic `ik`, and the service `toggle` that switches it on and off.

    Args:
        topics: Prefix of the name of the service `toggle`.
        message_type: Type of the problem messages.
        hz: Rate, in wall time [Hz].
        start_on_init: Whether publishing is switched on initially.
        problem: Function that returns the next problem. If a problem is not available, the function returns None, or
            raises an `InterfaceError` or `ValueError` with the reason, which is logged.
        has_solver_node: Whether to expect a solver node's solutions on `ik/solution`, see `SolverWatch`.
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
    """Logs a warning if the solver node has ended or does not answer. Publishes the state on /diagnostics.

    Args:
        problems: Publisher of the problems.
    """

    def __init__(self, problems: rospy.Publisher) -> None:
        self._problems = problems
        self._lock = threading.Lock()
        self._solver = ""
        self._asked_s: float | None = None
        """Time of the first problem after the newest solution; None if a problem has not been published since."""
        self._fault = ""
        self._diagnostics = rospy.Publisher("/diagnostics", DiagnosticArray, queue_size=10)
        rospy.Subscriber("ik/solution", rospy.AnyMsg, self._on_solution, queue_size=1)
        WallTimer(LOOK_HZ, self._look)

    def note_problem(self) -> None:
        """Records that a problem was published, so that a solution is expected."""
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
