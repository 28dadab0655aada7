"""The node `safe_robot_node.py`, which subscribes to targets of a robot and publishes safe commands."""

import gc
import sys
import time

import rospy
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, Header
from std_srvs.srv import Trigger, TriggerRequest, TriggerResponse

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.joint_values import JointValues
from custom_ros_tools.ros.joint_states import values_in
from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.ros.lifecycle.wall_time import WallTimer
from custom_ros_tools.ros.rospy_internals import DirectSending
from custom_ros_tools.sockets import flush_buffered_sockets
from safe_robot.check import Violation
from safe_robot.checks.staleness import too_old
from safe_robot.guard import Decision
from safe_robot.target_queue import TargetQueue

from .guard_markers import GuardMarkers
from .guard_status import GuardStatus, violation_of
from .master_connection import MasterConnection
from .measurements import Measurements
from .parameters import guard_of_parameters

NODE = "robot_safety_node"
QUEUE_SIZE = 1000
"""Number of messages buffered while the machine is busy; beyond it, the oldest are dropped.

It exceeds the targets of `staleness.timeout_s`: a busy machine leads to a violation of `staleness`, not to a jump.
"""
WATCH_HZ = 100.0
"""Rate at which the node checks that targets still arrive [Hz]."""
JUMP_S = 0.5
"""A stamp jumps if it is after the previous target's arrival by more than the time since then plus this value [s]."""
FIRST_STATE_S = 1.0
"""Longest wait for a measured state before the node subscribes to targets [s]."""
BODIES_TIMEOUT_S = 0.5
"""Largest age of the poses of bodies [s], for checks without the option `timeout_s`."""
NEVER_S = float("-inf")
REPEATED = "the stamp equals that of the previous target: both are one target, with one command"
SWITCH_S = 0.0005
"""Time after which Python switches to a waiting thread, such as one that has just received a target [s]."""


class GuardNode:
    """Checks targets with a guard, and publishes the commands that the guard returns.

    Raises:
        ConfigError: If a parameter, or the robot's description, is wrong.
    """

    def __init__(self) -> None:
        self._guard, config = guard_of_parameters()
        self._as_joint_state = config.publish_as_joint_state
        self._targets_are_states = config.targets_are_states
        self._silence_s = config.silence_s
        self._sent_s = self._repeated_s = NEVER_S
        self._last_stamp: tuple[rospy.Time, float, float] | None = None  # stamp, arrival [s], lateness at arrival [s]
        self._target_topic = rospy.resolve_name("joint_states/target")
        self._command = rospy.Publisher(
            "joint_states/command",
            JointState if self._as_joint_state else Float64MultiArray,
            queue_size=QUEUE_SIZE,  # a dropped command would make the next one a jump
            tcp_nodelay=True,
        )
        self._sending = DirectSending.of(self._command, QUEUE_SIZE)
        self._status = GuardStatus(self._guard, self._target_topic, config.status_as_diagnostic)
        takers = [check for check in self._guard.checks if check.takes_obstacles]
        timeout_s = min(
            (getattr(check.config, "timeout_s", BODIES_TIMEOUT_S) for check in takers), default=BODIES_TIMEOUT_S
        )
        base_frame = config.base_frame if takers else None
        self._measurements = Measurements(self._guard.joint_names, base_frame, config.left_out, timeout_s)
        self._guard.start()
        # `limit` and `shape` tolerate skipped targets; with `reject`, the next one would be a jump
        can_skip = self._guard.config.policy == "limit" or self._guard.config.shape
        size = 1 if can_skip else QUEUE_SIZE
        self._queue = TargetQueue(
            self._guard.config.period_s, self._silence_s, size, self._handle_target, self._end_wait
        )
        GuardMarkers(self._guard, self._queue.lock, config.base_frame or self._guard.robot.document.root_link())
        self._master = MasterConnection(self._lose_master)
        if self._guard.config.start_from == "measured":
            self._measurements.wait(FIRST_STATE_S)  # if the first target is dropped, the next may be too far away
        self._targets = rospy.Subscriber(
            self._target_topic, JointState, self._receive, queue_size=QUEUE_SIZE, tcp_nodelay=True
        )
        rospy.Service("robot_safety/start_subscriber", Trigger, self._start)
        rospy.Service("robot_safety/stop_subscriber", Trigger, self._stop)
        gc.collect()
        gc.freeze()  # existing objects are frozen, so that garbage collection is fast
        WallTimer(WATCH_HZ, self._watch)

    def _receive(self, message: JointState) -> None:
        stamp = message.header.stamp
        if self._targets_are_states:
            guarded = [each for each in zip(message.name, message.position) if each[0] in self._guard.joint_names]
            message = JointState(message.header, [name for name, _ in guarded], [q for _, q in guarded], [], [])
        self._queue.put(message, (_now() - stamp).to_sec() if stamp else 0.0)

    def _handle_target(self, message: JointState) -> bool:
        """Sends a command for a target, reports the decision, and returns whether a command was sent.

        While the node shuts down, topics are closed, and the target is dropped.
        """
        if self._guard.is_halted:
            if not rospy.core.is_shutdown_requested():
                self._status.warn_of_halt()
            return False
        try:
            decision = self._decide_on(message)
            if decision.command is not None:
                self._send(message, decision)
        except Exception as error:
            if rospy.core.is_shutdown_requested():
                return False
            decision = Decision(None, violation_of("input", f"the check raised an error: {error!r}"), True)
        try:
            self._report(message.header, decision)
        except rospy.ROSException:
            if not rospy.core.is_shutdown_requested():
                raise
            return False
        return decision.command is not None

    def _report(self, header: Header, decision: Decision) -> None:
        if decision.is_halted:
            self._halt(decision.violation, header)
        else:
            note = REPEATED if decision.command is None and decision.violation is None else ""
            self._status.publish(header, decision.violation, self._measurements.obstacles, note)

    def _end_wait(self, age_s: float) -> None:
        if not self._guard.is_halted:
            self._guard.wait_for_target()
            self._brake_for(too_old(age_s, self._silence_s, "silence_s"))

    def _lose_master(self) -> None:
        reason = f"the ROS master at {self._master.uri} has ended, so that nothing can call stop_subscriber"
        with self._queue.lock:
            if not self._guard.is_halted:
                self._halt(violation_of("master", reason))

    def _halt(self, violation: Violation | None, header: Header | None = None) -> None:
        self._guard.halt()
        self._brake_for(violation, header)

    def _brake_for(self, violation: Violation | None, header: Header | None = None) -> None:
        """Starts to send the guard's braking commands, if any, and reports the violation; the caller holds the lock."""
        self._queue.run_instead(self._brake)
        if violation is not None:
            self._status.publish(header or Header(stamp=_now()), violation, self._measurements.obstacles)

    def _brake(self) -> bool:
        """Sends the next braking command. Returns False if no command is left, or if sending failed."""
        command = self._guard.next_braking()
        if command is None:
            return False
        try:
            self._publish(self._message(Header(stamp=_now()), command))
        except Exception as error:
            rospy.logerr("braking aborted: %r", error)
            return False
        return True

    def _decide_on(self, message: JointState) -> Decision:
        try:
            values = self._guarded_values(message)
        except (InterfaceError, ValueError) as error:
            return self._guard.refuse(str(error))
        stamp, last = message.header.stamp, self._last_stamp
        age_s, step_s, since_s = 0.0, None, self._sent_s
        if last is not None and not stamp:
            return self._guard.refuse("expected a stamp, as previous targets had")
        if stamp:
            age_s, now_s = (_now() - stamp).to_sec(), time.monotonic()
            self._last_stamp = stamp, now_s, max(age_s, 0.0)
            if last is not None:
                step_s = (stamp - last[0]).to_sec()
                _, arrival_s, late_s = last
                if step_s - late_s > now_s - arrival_s + JUMP_S:
                    self._last_stamp = None  # the next target need not follow either of the two
                    return self._guard.refuse(f"stamps jump by {step_s:g} s")
                if step_s == 0.0:
                    self._last_stamp, self._repeated_s, since_s = last, now_s, arrival_s
            if self._guard.last_command is None and age_s > self._silence_s:  # the command waited for a connection
                return Decision(None, too_old(age_s, self._silence_s, "silence_s"))
        return self._guard.decide(values.position, self._measurements.context(since_s, age_s, step_s))

    def _guarded_values(self, message: JointState) -> JointValues:
        """Returns the values of the guarded joints, in the order of the guard's joints.

        Raises:
            MissingJointsError: If a guarded joint is missing.
            ValueError: If the message has values that the guard cannot check.
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

    def _send(self, message: JointState, decision: Decision) -> None:
        self._sent_s = time.monotonic()
        assert decision.command is not None
        is_same = self._as_joint_state and decision.violation is None and not decision.is_shaped
        self._publish(message if is_same else self._message(message.header, decision.command))

    def _message(self, header: Header, command: tuple[float, ...]) -> JointState | Float64MultiArray:
        if self._as_joint_state:
            return JointState(header=header, name=self._guard.joint_names, position=command)
        return Float64MultiArray(data=command)

    def _publish(self, message: JointState | Float64MultiArray) -> None:
        try:
            if self._sending is not None:
                self._sending.wrap_connections()
            self._command.publish(message)
            flush_buffered_sockets()
        except BaseException:
            self._guard.rest()  # braking must not start from a command that was not sent
            raise

    def _watch(self) -> None:
        flush_buffered_sockets()
        with self._queue.lock:
            if self._guard.is_halted:
                return
            if self._guard.is_moving and not self._targets.get_num_connections():
                reason = f"no node publishes {self._target_topic} any more, while the robot moves"
                self._halt(violation_of("source", reason))
                return
            try:
                last_s = max(self._sent_s, self._repeated_s)  # repeated targets are checked on arrival
                violation = self._guard.check_watchdogs(self._measurements.context(last_s))
            except Exception as error:
                violation = violation_of("input", f"a check raised an error: {error!r}")
            if violation is not None:
                self._brake_for(violation)  # the guard has halted, or waits for the next target

    def _start(self, _: TriggerRequest) -> TriggerResponse:
        with self._queue.lock:
            if not self._guard.is_halted:
                return TriggerResponse(False, "targets are already accepted")
            if self._guard.is_braking:
                return TriggerResponse(False, "the robot still brakes; call again when it rests")
            if not self._master.is_there:
                return TriggerResponse(False, f"the ROS master at {self._master.uri} has ended")
            self._last_stamp = None
            self._queue.clear()
            self._guard.start()
        return TriggerResponse(True, "targets are accepted; the first one has to be near the position of the robot")

    def _stop(self, _: TriggerRequest) -> TriggerResponse:
        with self._queue.lock:
            if self._guard.is_halted:
                return TriggerResponse(False, "no targets are accepted already")
            self._halt(None)
        return TriggerResponse(True, "no targets are accepted")


def _now() -> rospy.Time:
    """Returns ROS time if it is available, else wall time."""
    return rospy.Time.now() or rospy.Time.from_sec(time.time())


def main() -> None:
    """Runs the node."""
    sys.setswitchinterval(SWITCH_S)
    run_node(NODE, GuardNode, loggers=["robot_model", "rpbi"])
