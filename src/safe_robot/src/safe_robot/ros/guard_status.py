"""Publishes the decisions of the guard's node."""

import math

import rospy
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from std_msgs.msg import Header

from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning
from robot_model.collision.shapes import Obstacle
from safe_robot.check import Violation
from safe_robot.guard import Guard
from safe_robot.msg import Status
from safe_robot.msg import Violation as ViolationMessage

QUEUE_SIZE = 100
WARNING_PERIOD_S = 60.0
"""Shortest time between two warnings of one check while the guard is not halted [s].

The status topic reports every violation.
"""


def violation_of(check: str, reason: str) -> Violation:
    """Returns a violation without value and limit."""
    return Violation(check, reason, math.nan, math.nan, "")


class GuardStatus:
    """Publishes a status for each decision, and warns of violations.

    Args:
        guard: The guard.
        subject: Name of the target topic; warnings begin with this name.
        as_diagnostic: Whether the status is a `DiagnosticStatus`; otherwise a `safe_robot/Status`.
    """

    def __init__(self, guard: Guard, subject: str, as_diagnostic: bool = False) -> None:
        self._guard, self._subject, self._as_diagnostic = guard, subject, as_diagnostic
        kind = DiagnosticStatus if as_diagnostic else Status
        self._status = rospy.Publisher("robot_safety/status", kind, queue_size=QUEUE_SIZE, latch=True)
        self._violation = rospy.Publisher("robot_safety/violation", ViolationMessage, queue_size=QUEUE_SIZE, latch=True)
        self._warn = ThrottledWarning(WARNING_PERIOD_S, max_kinds=1)  # its messages name the nearest pair
        self._way_out_from: object = None
        self._way_out_words = ""

    def publish(
        self,
        header: Header,
        violation: Violation | None,
        obstacles: tuple[Obstacle, ...] | None = None,
        note: str = "",
    ) -> None:
        """Publishes the status of a decision, and the violation if there is one.

        Args:
            header: Header of the target.
            violation: Violation of the target; None if the target is safe.
            obstacles: Bodies of the environment; the same tuple object while no body changes.
            note: Text of the status if there is no violation.
        """
        if violation is None:
            self._status.publish(self._status_message(header, note, None))
            return
        message = f"{violation}{self._way_out(obstacles)}"
        self._status.publish(self._status_message(header, message, violation))
        self._violation.publish(
            ViolationMessage(
                header=header,
                check=violation.check,
                subject=violation.subject,
                value=violation.value,
                limit=violation.limit,
                is_while_braking=violation.is_while_braking,
                message=message,
            )
        )
        if self._guard.is_halted:  # always, even shortly after another warning
            then = "braking to rest, and halted" if self._guard.is_braking else "halted"
            rospy.logwarn("%s: %s; %s until robot_safety/start_subscriber is called", self._subject, message, then)
        else:
            check = f"{violation.check}: "
            self._warn(f"{self._subject}: {violation.check}", message.removeprefix(check))

    def _status_message(self, header: Header, text: str, violation: Violation | None) -> Status | DiagnosticStatus:
        if not self._as_diagnostic:
            return Status(header=header, message=text, is_safe=violation is None)
        status = DiagnosticStatus(level=DiagnosticStatus.OK, name=rospy.get_name(), message=text)
        status.values = [KeyValue("stamp", f"{header.stamp.to_sec():.9f}")]
        if violation is not None:
            status.level = DiagnosticStatus.ERROR
            status.values += [
                KeyValue(key, str(getattr(violation, key))) for key in ("check", "subject", "value", "limit")
            ]
        return status

    def warn_of_halt(self) -> None:
        """Warns that a target was ignored because the guard is halted."""
        self._warn(self._subject, "halted; call robot_safety/start_subscriber to continue")

    def _way_out(self, obstacles: tuple[Obstacle, ...] | None) -> str:
        """Returns a text about violated margins and a motion that reduces the violations; empty while the robot moves.

        The text is computed again only after the last command or the obstacles have changed.
        """
        if self._guard.is_moving:
            return ""
        place = self._guard.last_command, obstacles
        if self._way_out_from != place:
            self._way_out_from = place
            try:
                out = self._guard.way_out()
                self._way_out_words = "" if out is None else f"; {out.words(self._guard.joint_names)}"
            except Exception as error:
                self._way_out_words = f"; it is not known how to leave the margins: {error!r}"
        return self._way_out_words
