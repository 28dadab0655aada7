"""Watch over the solver that answers the problems of a setup node."""

import threading
import time

import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from std_msgs.msg import Header

from custom_ros_tools.ros.lifecycle.wall_time import WallTimer

LOOK_HZ = 1.0
SILENT_AFTER_S = 5.0
"""Longest time without a solution while problems are published [s]; beyond it, the solver is reported."""


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
