"""Where samples go: one outlet for each sensor, chosen by the type of its samples."""

from __future__ import annotations

from typing import Any, Protocol

from geometry_msgs.msg import TransformStamped
from sensor_msgs.msg import JointState
from tf2_msgs.msg import TFMessage

from ..samples import JointStateSample, LinkPoseSample
from .stamps import to_ros_time
from .topics import FastTopic

WORLD_FRAME = "rpbi/world"


class Outlet(Protocol):
    """Takes one type of samples."""

    def publish(self, sample: Any, stamp_ns: int) -> None:
        """Passes a sample on."""

    def flush(self) -> None:
        """Sends what was collected during the tick."""

    def serve_late(self) -> None:
        """Gives the last state to subscribers that have come since."""

    def forget(self, name: str) -> None:
        """Drops what it keeps of a body or sensor that has gone."""


class JointStateOutlet:
    """Joint states on `rpbi/NAME/joint_states`."""

    def __init__(self) -> None:
        self._topics: dict[str, FastTopic] = {}
        self._last: dict[str, tuple[JointStateSample, int]] = {}

    def open(self, name: str) -> None:
        """Advertises the topic of a robot; any thread may call it."""
        self._topics = {**self._topics, name: FastTopic(f"rpbi/{name}/joint_states", JointState)}

    def publish(self, sample: JointStateSample, stamp_ns: int) -> None:
        """Sends the joint states of a robot."""
        self._last[sample.name] = sample, stamp_ns
        topic = self._topics.get(sample.name)  # there is none as long as the robot is new
        if topic is not None and topic.has_subscribers:
            topic.publish(joint_state_message(sample, stamp_ns))

    def flush(self) -> None:
        """Has nothing to send: each robot has a topic of its own."""

    def serve_late(self) -> None:
        """Gives the last joint states to who has come since."""
        for name, topic in self._topics.items():
            if name in self._last:
                topic.serve_late(lambda last=self._last[name]: joint_state_message(*last))

    def forget(self, name: str) -> FastTopic | None:
        """Drops what it keeps of a robot.

        Returns:
            The robot's topic. Closing it is left to another thread, since the ROS master may be slow to answer.
        """
        self._last.pop(name, None)
        return self._topics.pop(name, None)


class TransformOutlet:
    """Link poses on TF, all that a tick has in one message."""

    def __init__(self) -> None:
        self._topic = FastTopic("/tf", TFMessage)
        self._last: dict[str, list[TransformStamped]] = {}
        self._collected: list[TransformStamped] = []

    def open(self, name: str) -> None:
        """Needs nothing: all bodies share the topic."""

    def publish(self, sample: LinkPoseSample, stamp_ns: int) -> None:
        """Collects the transforms of a body."""
        transforms = self._last.get(sample.name)
        if transforms is None or len(transforms) != len(sample.frames):
            transforms = self._last[sample.name] = [_transform(frame) for frame in sample.frames]
        stamp = to_ros_time(stamp_ns)
        for message, (position, quat) in zip(transforms, sample.poses, strict=True):
            message.header.stamp = stamp
            translation, rotation = message.transform.translation, message.transform.rotation
            translation.x, translation.y, translation.z = position
            rotation.x, rotation.y, rotation.z, rotation.w = quat
        self._collected += transforms

    def flush(self) -> None:
        """Sends what was collected."""
        if self._collected:
            if self._topic.has_subscribers:
                self._topic.publish(TFMessage(self._collected))
            self._collected = []

    def serve_late(self) -> None:
        """Gives all last poses to who has come since."""
        self._topic.serve_late(lambda: TFMessage([one for body in self._last.values() for one in body]))

    def forget(self, name: str) -> None:
        """Leaves a body out from now on."""
        self._last.pop(name, None)


def joint_state_message(sample: JointStateSample, stamp_ns: int) -> JointState:
    message = JointState(
        name=sample.joint_names, position=sample.position, velocity=sample.velocity, effort=sample.effort
    )
    message.header.stamp = to_ros_time(stamp_ns)
    return message


def _transform(frame: str) -> TransformStamped:
    message = TransformStamped(child_frame_id=frame)
    message.header.frame_id = WORLD_FRAME
    return message
