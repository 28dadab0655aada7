"""What comes from ROS into the world: subscriptions and TF, by way of the mailbox."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from typing import Any, NamedTuple

import rospy
import tf2_ros
from sensor_msgs.msg import JointState

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.throttle import ThrottledWarning

from ..inputs import Input, PoseInput
from ..joint_model import JointTarget
from ..pose import Pose
from ..world import World
from .outlets import WORLD_FRAME

log = logging.getLogger(__name__)

TF_MISSING_AFTER_S = 5.0
"""How long a TF frame may be missing before that is worth a warning [s] of wall time."""


class TopicInput(NamedTuple):
    """A topic that feeds an input.

    Attributes:
        topic: Name, with `{name}` for the body.
        message_type: ROS type.
        value: Turns a message into what the input takes.
    """

    topic: str
    message_type: type
    value: Callable[[Any], Any]


TOPIC_INPUTS: dict[str, TopicInput] = {
    "target": TopicInput(
        "rpbi/{name}/joint_states/target", JointState, lambda message: JointTarget(message.name, message.position)
    ),
}
"""The topic of each kind of input that comes by topic."""


class Inputs:
    """Subscribes to what the world takes; refused messages change nothing and are named now and then.

    Args:
        world: The world; only its `put` is used.
    """

    def __init__(self, world: World) -> None:
        self._world = world
        self._warn = ThrottledWarning()
        self._subscribers: dict[str, list[rospy.Subscriber]] = {}
        self._tf = _TfFollower(world.put)

    def open(self, name: str, inputs: dict[str, Input]) -> None:
        """Connects the inputs of a body or sensor."""
        subscribers = self._subscribers.setdefault(name, [])
        for key, taken in inputs.items():
            if isinstance(taken, PoseInput):
                self._tf.follow(f"{name}/{key}", taken)
            else:
                subscribers.append(self._subscribe(name, key, TOPIC_INPUTS[key]))

    def close(self, name: str) -> None:
        """Disconnects the inputs of a body or sensor."""
        for subscriber in self._subscribers.pop(name, []):
            subscriber.unregister()
        self._tf.leave(name)

    def _subscribe(self, name: str, key: str, topic_input: TopicInput) -> rospy.Subscriber:
        topic = topic_input.topic.format(name=name)

        def take(message: Any) -> None:
            try:
                self._world.put(f"{name}/{key}", topic_input.value(message))
            except (InterfaceError, ValueError) as error:
                self._warn(topic, f"message refused: {error}")

        return rospy.Subscriber(topic, topic_input.message_type, take, queue_size=100, tcp_nodelay=True)


class _TfFollower:
    """Looks up the TF frames that poses follow, in one thread, by wall time.

    It listens to TF only once there is something to follow.
    """

    def __init__(self, put: Callable[[str, Any], None]) -> None:
        self._put = put
        self._followed: dict[str, PoseInput] = {}
        self._thread: threading.Thread | None = None
        self._warn = ThrottledWarning(period_s=30.0)

    def follow(self, slot: str, pose_input: PoseInput) -> None:
        """Begins to follow a frame."""
        self._followed = {**self._followed, slot: pose_input}
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name="tf follower", daemon=True)
            self._thread.start()

    def leave(self, name: str) -> None:
        """Follows nothing for a body or sensor any more."""
        self._followed = {
            slot: pose_input for slot, pose_input in self._followed.items() if slot.split("/")[0] != name
        }

    def _run(self) -> None:
        buffer = tf2_ros.Buffer()
        tf2_ros.TransformListener(buffer)
        due_s: dict[str, float] = {}
        seen_s: dict[str, float] = {}
        last_pose: dict[str, Any] = {}
        while not rospy.is_shutdown():
            now_s = time.monotonic()
            for slot, pose_input in self._followed.items():
                if now_s < due_s.get(slot, 0.0):
                    continue
                due_s[slot] = now_s + 1.0 / pose_input.hz
                found = _look_up(buffer, pose_input.tf_id)
                if found is None:
                    if now_s - seen_s.setdefault(slot, now_s) > TF_MISSING_AFTER_S:
                        self._warn(slot, f"no TF from '{WORLD_FRAME}' to '{pose_input.tf_id}' so far; it stays put")
                elif found != last_pose.get(slot):
                    last_pose[slot] = found
                    self._hand_over(slot, found)
            next_s = min((due_s.get(slot, 0.0) for slot in self._followed), default=now_s + 0.1)
            time.sleep(min(max(next_s - time.monotonic(), 0.001), 0.1))

    def _hand_over(self, slot: str, pose: Pose) -> None:
        try:
            self._put(slot, pose)
        except (InterfaceError, ValueError) as error:
            self._warn(slot, f"TF refused: {error}")


def _look_up(buffer: tf2_ros.Buffer, frame: str) -> Pose | None:
    """Returns the newest pose of a frame in the world, None if there is none."""
    try:
        transform = buffer.lookup_transform(WORLD_FRAME, frame, rospy.Time(0)).transform
    except tf2_ros.TransformException:
        return None
    position, quat = transform.translation, transform.rotation
    return Pose((position.x, position.y, position.z), (quat.x, quat.y, quat.z, quat.w))
