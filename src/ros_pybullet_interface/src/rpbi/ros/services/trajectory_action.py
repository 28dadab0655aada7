"""The action `follow_joint_trajectory` of robots with a trajectory follower, for planners such as MoveIt."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from concurrent.futures import wait
from functools import cache
from queue import SimpleQueue
from typing import Any

import rospy
from actionlib import ActionServer
from actionlib.server_goal_handle import ServerGoalHandle
from actionlib_msgs.msg import GoalStatus
from control_msgs.msg import FollowJointTrajectoryAction

from custom_ros_tools.errors import InterfaceError
from rpbi.bodies.robots.robot import Robot
from rpbi.control.trajectories.motion import TrajectoryMotion
from rpbi.control.trajectories.request import ErrorCode, TrajectoryRefusedError
from rpbi.control.trajectories.trajectory import TrajectoryStateSample
from rpbi.engine.clock import Clock
from rpbi.ros.endpoints import Service
from rpbi.ros.headers import to_ros_time
from rpbi.ros.publishers.sample_topics import CONTROLLER, fill_state
from rpbi.ros.requests import BodyContext
from rpbi.ros.state_topic import FastTopic
from rpbi.world.actions import RecordedTrajectory

from .trajectory_commands import followers, goal_tolerances, trajectory_request

log = logging.getLogger(__name__)

ACTION = Service(f"rpbi/{{name}}/{CONTROLLER}/follow_joint_trajectory", FollowJointTrajectoryAction, None, followers)
MAX_TASKS = 100
"""Largest number of tasks that wait for the action's thread; beyond it, feedback is dropped."""
LONGEST_END_S = 5.0
"""Longest wait [s] for the answers to all goals when the action is closed."""


class StampedActionServer(ActionServer):
    """An action server for a node that does not use ROS time.

    In this node, rospy's time is wall time regardless of `use_sim_time`. actionlib's own server would stamp messages
    with wall time; this class stamps them with the world's clock. actionlib's server also sends messages in threads,
    which may lose the last messages when the server closes. This class sends without such threads, see `FastTopic`.

    Args:
        name: Name of the action.
        action_type: ROS type of the action.
        clock: The world's clock.
        on_goal: Called with the handle of a new goal; it must return at once.
        on_cancel: Called with the handle of a goal to cancel; it must return at once.
    """

    def __init__(
        self,
        name: str,
        action_type: type,
        clock: Clock,
        on_goal: Callable[[ServerGoalHandle], None],
        on_cancel: Callable[[ServerGoalHandle], None],
    ) -> None:
        super().__init__(name, action_type, on_goal, on_cancel, auto_start=False)
        self._clock = clock

    def initialize(self) -> None:
        """Opens the topics and starts the timer; actionlib's `start` calls this method."""
        super().initialize()
        for key in ("status_pub", "result_pub", "feedback_pub"):
            publisher: rospy.Publisher = getattr(self, key)
            # The new publisher opens before the old one closes: otherwise rospy would close the topic in between, and
            # new subscribers would be lost.
            setattr(self, key, _StampedTopic(publisher.resolved_name, publisher.data_class, self._clock))
            publisher.unregister()


class _StampedTopic(FastTopic):
    """A topic that stamps messages with the world's clock, and has the publisher methods that actionlib calls."""

    def __init__(self, topic: str, message_type: type, clock: Clock) -> None:
        super().__init__(topic, message_type)
        self._clock = clock

    def publish(self, message: Any) -> None:
        message.header.stamp = to_ros_time(self._clock.stamp_ns)
        try:
            super().publish(message)
        except rospy.ROSException:
            if not rospy.core.is_shutdown_requested():  # at shutdown, actionlib's timer publishes on closed topics
                raise

    def unregister(self) -> None:
        self.close()


def open_trajectory_action(context: BodyContext) -> Callable[[], None] | None:
    """Opens the action of a robot that has a trajectory follower.

    Returns:
        A function that closes the action; None if the body has no trajectory follower.
    """
    if not isinstance(context.body, Robot) or context.body.follower is None:
        return None
    return TrajectoryAction(context).close


_open_actions: set[TrajectoryAction] = set()


@cache
def _answer_before_shutdown() -> None:
    """Makes the shutdown of ROS wait for the answers to all goals; the goals end when the world is closed."""

    def answer() -> None:
        for action in list(_open_actions):
            action.answer_all()

    rospy.on_shutdown(answer)


class TrajectoryAction:
    """Serves the action `follow_joint_trajectory` of one robot.

    actionlib holds the same lock during callbacks and while a goal is answered. To avoid deadlocks, the simulation
    thread does not answer goals, and callbacks do not wait for the simulation thread. Instead, callbacks and the
    simulation thread put tasks into a queue, which a thread of this object processes.
    """

    def __init__(self, context: BodyContext) -> None:
        self._context = context
        self._motions: dict[ServerGoalHandle, TrajectoryMotion] = {}
        self._tasks: SimpleQueue[Callable[[], None] | None] = SimpleQueue()
        self._thread = threading.Thread(target=self._work, name=f"{context.name} trajectories", daemon=True)
        self._server = StampedActionServer(
            ACTION.name.format(name=context.name),
            ACTION.service_type,
            context.world.clock,
            on_goal=lambda goal: self._tasks.put(lambda: self._begin(goal)),
            on_cancel=lambda goal: self._tasks.put(lambda: self._cancel(goal)),
        )
        self._thread.start()
        self._server.start()
        _open_actions.add(self)
        _answer_before_shutdown()

    def close(self) -> None:
        """Answers all goals and closes the action, after the robot was removed."""
        _open_actions.discard(self)
        self.answer_all()
        self._server.stop()

    def answer_all(self) -> None:
        """Waits until all goals are answered, and ends the action's thread.

        Call this method when the motions of all goals have ended or are about to end.
        """
        wait([motion.result for motion in list(self._motions.values())], LONGEST_END_S)
        self._tasks.put(None)
        self._thread.join(LONGEST_END_S)

    def _work(self) -> None:
        while (task := self._tasks.get()) is not None:
            try:
                task()
            except Exception:  # the next goals must still be answered
                log.exception("%s: a goal could not be served", self._context.name)

    def _begin(self, goal: ServerGoalHandle) -> None:
        if goal.get_goal_status().status == GoalStatus.RECALLING:
            goal.set_canceled(self._result(ErrorCode.SUCCESSFUL, "cancelled before it began"))
            return

        def feed(state: TrajectoryStateSample) -> None:
            stamp_ns = self._context.world.clock.stamp_ns
            if self._tasks.qsize() < MAX_TASKS:
                self._tasks.put(lambda: goal.publish_feedback(self._feedback(state, stamp_ns)))

        clock, message = self._context.world.clock, goal.get_goal()
        try:
            request, tolerances = trajectory_request(message.trajectory), goal_tolerances(message)
            checked = self._context.body.follower.check(request, tolerances)

            def follow() -> TrajectoryMotion:
                record = RecordedTrajectory.of(request, tolerances, clock)
                motion: TrajectoryMotion = self._context.world.act(
                    self._context.name, "follow", record, lambda body: body.follower.follow(checked, clock, feed)
                )
                return motion

            motion = self._context.ask_body(follow)
        except InterfaceError as error:
            self._reject(
                goal, error.code if isinstance(error, TrajectoryRefusedError) else ErrorCode.INVALID_GOAL, error
            )
            return
        except Exception as error:  # the client must get an answer for any error in a goal
            log.exception("a goal failed with an unexpected error")
            self._reject(goal, ErrorCode.INVALID_GOAL, error)
            return
        goal.set_accepted()
        self._motions[goal] = motion
        motion.result.add_done_callback(lambda _: self._tasks.put(lambda: self._finish(goal)))

    def _reject(self, goal: ServerGoalHandle, code: ErrorCode, error: Exception) -> None:
        log.warning("%s: goal refused: %s", self._context.name, error)
        goal.set_rejected(self._result(code, str(error)), str(error))

    def _cancel(self, goal: ServerGoalHandle) -> None:
        motion = self._motions.get(goal)
        if motion is None:
            return  # the motion has ended before
        try:
            self._context.ask_body(lambda: self._stop_motion(motion))
        except InterfaceError as error:
            log.warning("%s: could not cancel a goal: %s", self._context.name, error)

    def _stop_motion(self, motion: TrajectoryMotion) -> None:
        if self._context.body.drive.motion is motion:  # otherwise a newer motion has replaced it
            self._context.world.act(self._context.name, "cancel", "cancelled; the joints hold")

    def _finish(self, goal: ServerGoalHandle) -> None:
        motion = self._motions.pop(goal)
        success, message = motion.result.result()
        result = self._result(motion.code, message)
        if success:
            goal.set_succeeded(result, message)
        elif motion.preempted:
            goal.set_canceled(result, message)
        else:
            log.warning("%s: goal aborted: %s", self._context.name, message)
            goal.set_aborted(result, message)

    def _feedback(self, state: TrajectoryStateSample, stamp_ns: int) -> Any:
        return fill_state(self._server.ActionFeedback().feedback, state, stamp_ns)

    def _result(self, code: ErrorCode, message: str) -> Any:
        result = self._server.ActionResultType()
        result.error_code, result.error_string = int(code), message
        return result
