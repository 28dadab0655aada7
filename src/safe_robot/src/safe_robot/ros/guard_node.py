"""`safe_robot_node.py`: targets of a robot in, safe commands out."""

import time
from collections.abc import Mapping

import rospy
from geometry_msgs.msg import WrenchStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, Header
from std_srvs.srv import Trigger, TriggerRequest, TriggerResponse

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.joint_values import JointValues
from custom_ros_tools.ros.joint_states import values_in
from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning, WallTimer
from safe_robot.check import Situation, Violation
from safe_robot.guard import Decision
from safe_robot.msg import Status
from safe_robot.msg import Violation as ViolationMessage

from .guard_markers import GuardMarkers
from .live_obstacles import LiveObstacles
from .master_connection import MasterConnection
from .parameters import guard_of_parameters
from .target_queue import TargetQueue

NODE = "robot_safety_node"
QUEUE_SIZE = 100
"""Messages kept while the machine is busy; what has become too old is refused."""
WATCH_HZ = 100.0
"""How often it is looked whether targets still come."""
JUMP_S = 0.5
"""How much further than the time that has gone by a stamp may be from the one before [s]."""
NEVER_S = float("-inf")


class GuardNode:
    """Publishes commands for those targets that are safe.

    Raises:
        ConfigError: If a parameter, or the robot, is wrong.
    """

    def __init__(self) -> None:
        self._guard, config = guard_of_parameters()
        self._as_joint_state = config.publish_as_joint_state
        self._targets_are_states = config.targets_are_states
        self._silence_s = config.silence_s
        base_frame = config.base_frame if any(check.takes_obstacles for check in self._guard.checks) else None
        self._around = None if base_frame is None else LiveObstacles(base_frame, config.left_out)
        self._warn = ThrottledWarning()
        self._way_out_from: object = None
        self._way_out_words = ""
        self._sent_s = NEVER_S
        self._last_stamp: tuple[rospy.Time, float] | None = None
        self._measured: tuple[Mapping[str, float], float] = {}, NEVER_S
        self._wrench: tuple[tuple[float, ...], float] = (0.0,) * 6, NEVER_S
        self._target_topic = rospy.resolve_name("joint_states/target")
        self._command = rospy.Publisher(
            "joint_states/command",
            JointState if self._as_joint_state else Float64MultiArray,
            queue_size=QUEUE_SIZE,  # a command that is left out would make the next one a jump
            tcp_nodelay=True,
        )
        self._status = rospy.Publisher("robot_safety/status", Status, queue_size=QUEUE_SIZE, latch=True)
        self._violation = rospy.Publisher("robot_safety/violation", ViolationMessage, queue_size=QUEUE_SIZE, latch=True)
        self._guard.start()
        # what limits or shapes can skip late targets; a skipped one makes the next a jump, at which `reject` halts
        can_skip = self._guard.config.policy == "limit" or self._guard.config.shape
        size = 1 if can_skip else QUEUE_SIZE
        self._queue = TargetQueue(self._guard.config.period_s, self._silence_s, size, self._take, self._end_wait)
        GuardMarkers(self._guard, self._queue.lock, config.base_frame or self._guard.robot.document.root_link())
        self._master = MasterConnection(self._lose_master)
        rospy.Service("robot_safety/start_subscriber", Trigger, self._start)
        rospy.Service("robot_safety/stop_subscriber", Trigger, self._stop)
        options = {"queue_size": QUEUE_SIZE, "tcp_nodelay": True}
        rospy.Subscriber("joint_states/measured", JointState, self._take_measured, **options)
        rospy.Subscriber("robot_safety/wrench", WrenchStamped, self._take_wrench, **options)
        self._targets = rospy.Subscriber(self._target_topic, JointState, self._receive, **options)
        WallTimer(WATCH_HZ, self._watch)

    def _receive(self, message: JointState) -> None:
        stamp = message.header.stamp
        if self._targets_are_states:
            guarded = [each for each in zip(message.name, message.position) if each[0] in self._guard.joint_names]
            message = JointState(message.header, [name for name, _ in guarded], [q for _, q in guarded], [], [])
        self._queue.put(message, (_now() - stamp).to_sec() if stamp else 0.0)

    def _take(self, message: JointState) -> bool:
        """Decides on a target; returns whether a command has gone out."""
        if self._guard.is_halted:
            self._warn(self._target_topic, "halted; call robot_safety/start_subscriber to go on")
            return False
        try:
            decision = self._decide(message)
            if decision.command is not None:
                self._send(message, decision)
        except Exception as error:
            self._guard.halt()
            decision = Decision(None, Violation("input", f"it cannot be judged: {error!r}", *NO_NUMBERS), True)
        self._tell(message.header, decision.violation, decision.is_halted)
        return decision.command is not None

    def _end_wait(self, age_s: float) -> None:
        self._halt(Violation("staleness", "the newest target", age_s, self._silence_s, "s of age"))

    def _lose_master(self) -> None:
        reason = f"the ROS master at {self._master.uri} has gone, and nobody could find stop_subscriber"
        with self._queue.lock:
            self._halt(Violation("master", reason, *NO_NUMBERS))

    def _halt(self, violation: Violation) -> None:
        """Halts for a reason that no target is to blame for; the queue's lock is held."""
        if self._guard.is_halted:
            return
        self._guard.halt()
        self._queue.clear()
        self._tell(Header(stamp=_now()), violation, True)

    def _decide(self, message: JointState) -> Decision:
        try:
            values = self._checked(message)
        except (InterfaceError, ValueError) as error:
            return self._guard.refuse(str(error))
        stamp = message.header.stamp
        age_s, step_s = 0.0, None
        if stamp:
            age_s, now_s = (_now() - stamp).to_sec(), time.monotonic()
            if self._last_stamp is not None:
                step_s = (stamp - self._last_stamp[0]).to_sec()
                if step_s > now_s - self._last_stamp[1] + JUMP_S:
                    return self._guard.refuse(f"stamps jump by {step_s:g} s")
            self._last_stamp = stamp, now_s
            if self._guard.last_command is None and age_s > self._silence_s:  # it waited for a connection
                return Decision(None, Violation("staleness", "the first target", age_s, self._silence_s, "s of age"))
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
            obstacles=None if self._around is None else self._around.obstacles,
        )

    def _send(self, message: JointState, decision: Decision) -> None:
        self._sent_s = time.monotonic()
        if not self._as_joint_state:
            self._command.publish(Float64MultiArray(data=decision.command))
        elif decision.violation is None and not decision.is_shaped:
            self._command.publish(message)  # to the last bit as it came
        else:
            names = self._guard.joint_names
            self._command.publish(JointState(header=message.header, name=names, position=decision.command))

    def _tell(self, header: Header, violation: Violation | None, is_halted: bool) -> None:
        if violation is None:
            self._status.publish(Status(header=header, message="", is_safe=True))
            return
        message = f"{violation}{self._way_out()}"
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
        if is_halted:  # in any case, whatever has been warned of a moment ago
            what = f"{message}; halted until robot_safety/start_subscriber is called"
            rospy.logwarn("%s: %s", self._target_topic, what)
        else:
            self._warn(self._target_topic, message)

    def _way_out(self) -> str:
        """Returns how the robot leaves the margins that it stands in, in words; it is looked for once at each place."""
        if self._guard.is_moving:
            return ""
        place = self._guard.last_command, self._around and self._around.obstacles
        if self._way_out_from != place:
            self._way_out_from = place
            try:
                out = self._guard.way_out()
                self._way_out_words = "" if out is None else f"; {out.words(self._guard.joint_names)}"
            except Exception as error:
                self._way_out_words = f"; it is not known how to leave the margins: {error!r}"
        return self._way_out_words

    def _watch(self) -> None:
        with self._queue.lock:
            if self._guard.is_halted:
                return
            if self._guard.is_moving and not self._targets.get_num_connections():
                reason = f"nobody sends {self._target_topic} any more, while the robot moves"
                self._halt(Violation("source", reason, *NO_NUMBERS))
            elif violation := self._guard.late(self._situation()):
                self._queue.clear()
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
        with self._queue.lock:
            if not self._guard.is_halted:
                return TriggerResponse(False, "targets are taken already")
            if not self._master.is_there:
                return TriggerResponse(False, f"the ROS master at {self._master.uri} has gone")
            self._last_stamp = None
            self._queue.clear()
            self._guard.start()
        return TriggerResponse(True, "targets are taken; the first one has to be where the robot is")

    def _stop(self, _: TriggerRequest) -> TriggerResponse:
        with self._queue.lock:
            if self._guard.is_halted:
                return TriggerResponse(False, "no targets are taken already")
            self._guard.halt()
        return TriggerResponse(True, "no targets are taken")


NO_NUMBERS = (float("nan"), float("nan"), "")


def _now() -> rospy.Time:
    """Returns ROS time if it has begun, else wall time."""
    return rospy.Time.now() or rospy.Time.from_sec(time.time())


def main() -> None:
    """Runs the node."""
    run_node(NODE, GuardNode, loggers=["rpbi"])
