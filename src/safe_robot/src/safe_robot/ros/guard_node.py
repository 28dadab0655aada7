"""`safe_robot_node.py`: targets of a robot in, safe commands out."""

import threading
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import rospy
from geometry_msgs.msg import WrenchStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, Header
from std_srvs.srv import Trigger, TriggerRequest, TriggerResponse

from custom_ros_tools.errors import ConfigError, InterfaceError, Problem
from custom_ros_tools.joint_values import JointValues
from custom_ros_tools.ros.joint_states import values_in
from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning, WallTimer
from rpbi.urdf.files import write_description
from safe_robot import legacy
from safe_robot.check import Situation, Violation
from safe_robot.config import GuardConfig, OutputConfig
from safe_robot.guard import Decision, Guard
from safe_robot.msg import Status
from safe_robot.msg import Violation as ViolationMessage
from safe_robot.robot import GuardedRobot

NODE = "robot_safety_node"
DESCRIPTION = "robot_description"
QUEUE_SIZE = 100
"""Messages kept while the machine is busy; what has become too old is refused."""
WATCH_HZ = 100.0
"""How often it is looked whether targets still come."""
NEVER_S = float("-inf")


class GuardNode:
    """Publishes commands for those targets that are safe.

    Raises:
        ConfigError: If a parameter, or the robot, is wrong.
    """

    def __init__(self) -> None:
        self._guard, as_joint_state = _guard_of_parameters()
        self._period_s = self._guard.config.period_s
        self._lock = threading.Lock()
        self._warn = ThrottledWarning()
        self._due_s = self._sent_s = NEVER_S
        self._last_stamp: rospy.Time | None = None
        self._measured: tuple[Mapping[str, float], float] = {}, NEVER_S
        self._wrench: tuple[tuple[float, ...], float] = (0.0,) * 6, NEVER_S
        self._target_topic = rospy.resolve_name("joint_states/target")
        self._as_joint_state = as_joint_state
        self._command = rospy.Publisher(
            "joint_states/command",
            JointState if as_joint_state else Float64MultiArray,
            queue_size=QUEUE_SIZE,  # a command that is left out would make the next one a jump
            tcp_nodelay=True,
        )
        self._status = rospy.Publisher("robot_safety/status", Status, queue_size=QUEUE_SIZE, latch=True)
        self._violation = rospy.Publisher("robot_safety/violation", ViolationMessage, queue_size=QUEUE_SIZE, latch=True)
        self._guard.start()
        rospy.Service("robot_safety/start_subscriber", Trigger, self._start)
        rospy.Service("robot_safety/stop_subscriber", Trigger, self._stop)
        options = {"queue_size": QUEUE_SIZE, "tcp_nodelay": True}
        rospy.Subscriber("joint_states/measured", JointState, self._take_measured, **options)
        rospy.Subscriber("robot_safety/wrench", WrenchStamped, self._take_wrench, **options)
        rospy.Subscriber(self._target_topic, JointState, self._take, **options)
        WallTimer(WATCH_HZ, self._watch)

    def _take(self, message: JointState) -> None:
        with self._lock:
            if self._guard.is_halted:
                self._warn(self._target_topic, "halted; call robot_safety/start_subscriber to go on")
                return
            self._wait_until_due()
            try:
                decision = self._decide(message)
            except Exception as error:
                self._guard.halt()
                decision = Decision(None, Violation("input", f"it cannot be judged: {error!r}", *NO_NUMBERS), True)
            if decision.command is not None:
                self._send(message, decision)
        self._tell(message.header, decision.violation, decision.is_halted)

    def _wait_until_due(self) -> None:
        """Waits until a period is over since the last command, so that what comes in a burst goes out one by one."""
        now_s = time.monotonic()
        if now_s < self._due_s:
            time.sleep(self._due_s - now_s)
        else:
            self._due_s = now_s

    def _decide(self, message: JointState) -> Decision:
        try:
            values = self._checked(message)
        except (InterfaceError, ValueError) as error:
            return self._guard.refuse(str(error))
        stamp = message.header.stamp
        age_s, step_s = 0.0, None
        if stamp:
            age_s = (_now() - stamp).to_sec()
            step_s = None if self._last_stamp is None else (stamp - self._last_stamp).to_sec()
            self._last_stamp = stamp
        return self._guard.decide(values.position, self._situation(age_s, step_s))

    def _checked(self, message: JointState) -> JointValues:
        """Returns the positions of the guarded joints, in order.

        Raises:
            MissingJointsError: If some are missing.
            ValueError: If there is something that the guard cannot answer for.
        """
        values, names = values_in(message), self._guard.joint_names
        ordered = values.in_order(names)
        if more := {*values.names}.difference(names, self._guard.robot.still):
            raise ValueError(f"expected the guarded joints only, got '{min(more)}' too")
        if not values.position:
            raise ValueError("expected positions, got none")
        if values.effort:
            raise ValueError("expected no efforts, which cannot be checked")
        for name, speed, most in zip(names, ordered.velocity, self._guard.limits.velocity):
            if not abs(speed) <= most:
                raise ValueError(f"joint '{name}': expected a velocity within {most:g}, got {speed:g}")
        return ordered

    def _situation(self, age_s: float = 0.0, stamp_step_s: float | None = None) -> Situation:
        now_s = time.monotonic()
        (measured, measured_s), (wrench, wrench_s) = self._measured, self._wrench
        return Situation(
            now_s=now_s,
            age_s=age_s,
            stamp_step_s=stamp_step_s,
            since_command_s=now_s - self._sent_s,
            measured=measured,
            measured_age_s=now_s - measured_s,
            wrench=wrench,
            wrench_age_s=now_s - wrench_s,
        )

    def _send(self, message: JointState, decision: Decision) -> None:
        self._due_s += self._period_s
        self._sent_s = time.monotonic()
        if not self._as_joint_state:
            self._command.publish(Float64MultiArray(data=decision.command))
        elif decision.violation is None:
            self._command.publish(message)  # to the last bit as it came
        else:
            names = self._guard.joint_names
            self._command.publish(JointState(header=message.header, name=names, position=decision.command))

    def _tell(self, header: Header, violation: Violation | None, is_halted: bool) -> None:
        if violation is None:
            self._status.publish(Status(header=header, message="", is_safe=True))
            return
        message = str(violation)
        self._status.publish(Status(header=header, message=message, is_safe=False))
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
        then = "; halted until robot_safety/start_subscriber is called" if is_halted else ""
        self._warn(self._target_topic, f"{message}{then}")

    def _watch(self) -> None:
        with self._lock:
            violation = self._guard.late(self._situation())
        if violation is not None:
            self._tell(Header(stamp=_now()), violation, True)

    def _take_measured(self, message: JointState) -> None:
        try:
            values = values_in(message)
            values.in_order(self._guard.joint_names)
        except (InterfaceError, ValueError) as error:
            self._warn("joint_states/measured", f"message refused: {error}")
            return
        self._measured = dict(zip(values.names, values.position)), time.monotonic()

    def _take_wrench(self, message: WrenchStamped) -> None:
        force, torque = message.wrench.force, message.wrench.torque
        wrench = (force.x, force.y, force.z, torque.x, torque.y, torque.z)
        self._wrench = wrench, time.monotonic()

    def _start(self, _: TriggerRequest) -> TriggerResponse:
        with self._lock:
            if not self._guard.is_halted:
                return TriggerResponse(False, "targets are taken already")
            self._last_stamp = None
            self._guard.start()
        return TriggerResponse(True, "targets are taken; the first one has to be where the robot is")

    def _stop(self, _: TriggerRequest) -> TriggerResponse:
        with self._lock:
            if self._guard.is_halted:
                return TriggerResponse(False, "no targets are taken already")
            self._guard.halt()
        return TriggerResponse(True, "no targets are taken")


NO_NUMBERS = (float("nan"), float("nan"), "")


def _now() -> rospy.Time:
    """Returns ROS time if it has begun, else wall time."""
    return rospy.Time.now() or rospy.Time.from_sec(time.time())


def _guard_of_parameters() -> tuple[Guard, bool]:
    """Returns the guard that private parameters and `robot_description` tell of, and whether it sends joint states."""
    node = rospy.get_name()
    given: dict[str, Any] = dict(rospy.get_param("~", {}))
    given.pop(DESCRIPTION, None)
    output = OutputConfig.parse({key: given.pop(key) for key in OutputConfig.model_fields if key in given}, node)
    path = _description_file()
    config = GuardConfig.parse(legacy.translated(given, list(GuardedRobot(path).joint_names), node), node)
    try:
        robot = GuardedRobot(path, config.joint_names)
    except InterfaceError as error:
        raise ConfigError([Problem(node, "joint_names", str(error))]) from None
    return Guard(config, robot, node), output.publish_as_joint_state


def _description_file() -> str:
    """Returns a file of the robot's description.

    Raises:
        ConfigError: If there is none.
    """
    key = rospy.search_param(DESCRIPTION)
    text = None if key is None else rospy.get_param(key)
    if not isinstance(text, str):
        message = f"expected the robot's URDF in the parameter '{DESCRIPTION}', got nothing"
        raise ConfigError([Problem(rospy.get_name(), DESCRIPTION, message)])
    return write_description(text.replace("file://", "")) if "<" in text else str(Path(text))


def main() -> None:
    """Runs the node."""
    run_node(NODE, GuardNode, loggers=["rpbi"])
