"""What comes from ROS into the world: subscriptions and TF, by way of the mailbox."""

from __future__ import annotations

import contextlib
import logging
import threading
import time
from collections.abc import Callable
from typing import Any, NamedTuple

import geometry_msgs.msg
import rospy
from sensor_msgs.msg import JointState

from custom_ros_tools.errors import ConfigError, InterfaceError, PluginError, Problem
from custom_ros_tools.plugins import cause_of, full_name
from custom_ros_tools.ros.lifecycle.throttle import ThrottledWarning
from rpbi.engine.inputs import Input, PoseInput
from rpbi.geometry import Pose, Twist
from rpbi.plugins import is_foreign
from rpbi.ros.publishers.sample_topics import find_topic
from rpbi.urdf.joints import JointTarget, WrongQuantityError
from rpbi.world import World

from .headers import world_frame
from .tf_listener import TfListener

log = logging.getLogger(__name__)

TF_MISSING_AFTER_S = 5.0
"""How long a TF frame may be missing before that is worth a warning [s] of wall time."""
LONGEST_NAP_S = 0.1
"""How soon a new frame to follow is noticed [s] of wall time."""


class TopicInput(NamedTuple):
    """A topic that feeds an input.

    Attributes:
        topic: Name, with `{name}` for the body.
        message_type: ROS type.
        value: Turns a message into what the input takes.
        meaning: What a message does, in a sentence.
    """

    topic: str
    message_type: type
    value: Callable[[Any], Any]
    meaning: str = ""


def _joint_target(message: JointState) -> JointTarget:
    """Returns all that a message has; which of it counts is up to the robot's control mode."""
    return JointTarget(message.name, message.position, message.velocity, message.effort)


def _twist(message: geometry_msgs.msg.Twist) -> Twist:
    linear, angular = message.linear, message.angular
    return Twist((linear.x, linear.y, linear.z), (angular.x, angular.y, angular.z))


TOPIC_INPUTS: dict[str, TopicInput] = {
    "target": TopicInput(
        "rpbi/{name}/joint_states/target",
        JointState,
        _joint_target,
        "Targets: positions [rad or m], velocities or efforts by the control mode; joints not named keep theirs.",
    ),
    "cmd_vel": TopicInput(
        "rpbi/{name}/cmd_vel",
        geometry_msgs.msg.Twist,
        _twist,
        "Velocity of a planar base in its own frame [m/s, rad/s], for `cmd_vel_timeout_s`.",
    ),
}
"""The topic of each kind of input that comes by topic."""


def topic_input(key: str, taken: Input) -> TopicInput:
    """Returns the topic of an input.

    Args:
        key: Its name on its body.
        taken: The input.

    Raises:
        ConfigError: If it comes from another package and has no topic that can be found.
    """
    if taken.ros_topic:
        return find_topic(taken.ros_topic, TopicInput, taken.apply)
    if key not in TOPIC_INPUTS:
        message = f"missing, expected 'module:NAME' of the TopicInput for its input '{key}'"
        raise ConfigError([Problem(full_name(taken.apply), "ros_topic", message)])
    return TOPIC_INPUTS[key]


class Inputs:
    """Subscribes to what the world takes; refused messages change nothing and are named now and then.

    Args:
        world: The world; only its `put` is used.
    """

    def __init__(self, world: World) -> None:
        self._world = world
        self._warn = ThrottledWarning()
        self._warn_seldom = ThrottledWarning(period_s=60.0)  # a controller made for another mode sends on and on
        self._subscribers: dict[str, list[rospy.Subscriber]] = {}
        self._tf = _TfFollower(world.put)

    def open(self, name: str, inputs: dict[str, Input]) -> None:
        """Connects the inputs of a body or sensor."""
        subscribers = self._subscribers.setdefault(name, [])
        for key, taken in inputs.items():
            if isinstance(taken, PoseInput):
                self._tf.follow(name, f"{name}/{key}", taken)
            else:
                subscribers.append(self._subscribe(name, key, taken))

    def close(self, name: str) -> None:
        """Disconnects the inputs of a body or sensor."""
        for subscriber in self._subscribers.pop(name, []):
            subscriber.unregister()
        self._tf.leave(name)

    def repeat_poses(self) -> None:
        """Hands the last poses of TF frames to a world that has forgotten them; any thread may call it."""
        self._tf.repeat()

    def _subscribe(self, name: str, key: str, taken: Input) -> rospy.Subscriber:
        topic_name, message_type, value, _ = topic_input(key, taken)
        topic, slot = rospy.resolve_name(topic_name.format(name=name)), f"{name}/{key}"

        def take(message: Any) -> None:
            try:
                self._world.put(slot, value(message))
            except WrongQuantityError as error:
                self._warn_seldom(topic, f"message refused: {error}")
            except Exception as error:
                self._warn(topic, f"message refused: {_refusal(slot, taken, error)}")

        return rospy.Subscriber(topic, message_type, take, queue_size=100, tcp_nodelay=True)


def _refusal(slot: str, taken: Input, error: Exception) -> Exception:
    """Returns why a value is refused: what its check says, or what went wrong in another package.

    Args:
        slot: Where the value was to go.
        taken: The input.
        error: What was raised.

    Raises:
        Exception: The error, if it is a bug of this package.
    """
    if isinstance(error, (InterfaceError, ValueError)):
        return error
    if is_foreign(taken.apply):
        return PluginError(full_name(taken.apply), f"taking '{slot}'", cause_of(error))
    raise error


class _Followed:
    """A pose input and what is known of its frame.

    Args:
        name: The body or sensor.
        slot: Where its pose goes.
        pose_input: What it follows.
    """

    def __init__(self, name: str, slot: str, pose_input: PoseInput) -> None:
        self.name, self.slot, self.pose_input = name, slot, pose_input
        self.tf_id = pose_input.tf_id
        self.period_s = 1.0 / pose_input.hz
        self.due_s = self.since_s = time.monotonic()
        self.last_pose: Pose | None = None


class _TfFollower:
    """Looks up the TF frames that poses follow, in one thread, by wall time.

    It listens to TF only once there is something to follow.
    """

    def __init__(self, put: Callable[[str, Any], None]) -> None:
        self._put = put
        self._followed: tuple[_Followed, ...] = ()
        self._listener: TfListener | None = None
        self._warn = ThrottledWarning(period_s=30.0)

    def follow(self, name: str, slot: str, pose_input: PoseInput) -> None:
        """Begins to follow a frame for a body or sensor."""
        self._followed = (*self._followed, _Followed(name, slot, pose_input))
        if self._listener is None:
            self._listener = TfListener()
            threading.Thread(target=self._run, args=(self._listener,), name="tf follower", daemon=True).start()

    def leave(self, name: str) -> None:
        """Follows nothing for a body or sensor any more."""
        self._followed = tuple(followed for followed in self._followed if followed.name != name)

    def repeat(self) -> None:
        """Puts all last poses again."""
        for followed in self._followed:
            if followed.last_pose is not None:
                with contextlib.suppress(Exception):  # gone meanwhile, or refused as it was before
                    self._put(followed.slot, followed.last_pose)

    def _run(self, listener: TfListener) -> None:
        while not rospy.is_shutdown():
            followed = self._followed
            now_s = time.monotonic()
            for each in followed:
                if now_s >= each.due_s:
                    each.due_s = now_s + each.period_s
                    self._look(listener, each, now_s)
            next_s = min((each.due_s for each in followed), default=now_s + LONGEST_NAP_S)
            time.sleep(min(max(next_s - time.monotonic(), 0.001), LONGEST_NAP_S))

    def _look(self, listener: TfListener, followed: _Followed, now_s: float) -> None:
        pose = listener.pose(world_frame(), followed.tf_id)
        if pose is None:
            if followed.last_pose is None and now_s - followed.since_s > TF_MISSING_AFTER_S:
                self._warn(
                    followed.slot, f"no TF from '{world_frame()}' to '{followed.tf_id}' so far; it stays where it is"
                )
        elif pose != followed.last_pose:
            followed.last_pose = pose
            try:
                self._put(followed.slot, pose)
            except Exception as error:
                refusal = _refusal(followed.slot, followed.pose_input, error)
                if followed in self._followed:  # else it has gone meanwhile
                    self._warn(followed.slot, f"TF refused: {refusal}")
