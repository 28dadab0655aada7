"""Where samples go: one outlet for each type of samples."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

from geometry_msgs.msg import TransformStamped, Vector3, Wrench, WrenchStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker, MarkerArray

from ros_pybullet_interface.msg import Contacts

from ..control.controller_state import ControllerState
from ..samples import (
    BaseStateSample,
    ContactArrowsSample,
    ContactsSample,
    JointStateSample,
    LinkPoseSample,
    SurfaceSample,
    WrenchSample,
)
from .contacts_messages import contact_arrows_message, contacts_message
from .frames import prefixed, world_frame
from .odometry import odometry_message
from .stamps import to_ros_time
from .surface_message import surface_message
from .topics import FastTopic
from .trajectory_messages import CONTROLLER, JointTrajectoryControllerState, state_message


class SampleTopic(NamedTuple):
    """The topic of one type of samples.

    Attributes:
        topic: Its name, with `{name}` for the sensor.
        message_type: ROS type.
        to_message: Makes the message of a sample and its stamp [ns].
    """

    topic: str
    message_type: type
    to_message: Callable[[Any, int], Any]


class Outlet(Protocol):
    """Takes one type of samples."""

    def publish(self, sample: Any, stamp_ns: int) -> None:
        """Passes a sample on."""

    def flush(self) -> None:
        """Sends what was collected during the tick."""

    def serve_late(self) -> None:
        """Gives the last state to subscribers that have come since."""

    def forget(self, name: str) -> FastTopic | None:
        """Drops what it keeps of a body or sensor that has gone; returns its topic, if it has one to close."""

    def restart(self) -> None:
        """Drops what it keeps of all samples: the world was reset."""


class SampleOutlet:
    """Samples of one type, each sensor on a topic of its own.

    Args:
        sample_topic: The topics and what is sent on them.
    """

    def __init__(self, sample_topic: SampleTopic) -> None:
        self._pattern, self._message_type, self._to_message = sample_topic
        self._topics: dict[str, FastTopic] = {}
        self._last: dict[str, tuple[Any, int]] = {}

    def open(self, name: str) -> None:
        """Advertises the topic of a sensor; any thread may call it."""
        topic = FastTopic(self._pattern.format(name=name), self._message_type)
        self._topics = {**self._topics, name: topic}

    def publish(self, sample: Any, stamp_ns: int) -> None:
        """Sends a sample."""
        self._last[sample.name] = sample, stamp_ns
        topic = self._topics.get(sample.name)  # there is none as long as the body is new
        if topic is not None and topic.has_subscribers:
            topic.publish(self._to_message(sample, stamp_ns))

    def flush(self) -> None:
        """Has nothing to send: each sensor has a topic of its own."""

    def serve_late(self) -> None:
        """Gives the last samples to who has come since."""
        for name, topic in self._topics.items():
            if name in self._last:
                topic.serve_late(lambda last=self._last[name]: self._to_message(*last))

    def restart(self) -> None:
        """Drops what it keeps of all samples; the topics stay."""
        self._last.clear()

    def forget(self, name: str) -> FastTopic | None:
        """Drops what it keeps of a sensor.

        Returns:
            Its topic. Closing it is left to another thread, since the ROS master may be slow to answer.
        """
        self._last.pop(name, None)
        topics = dict(self._topics)
        topic = topics.pop(name, None)
        self._topics = topics
        return topic


class TransformOutlet:
    """Link poses on TF, all that a tick has in one message."""

    def __init__(self) -> None:
        self._topic = FastTopic("/tf", TFMessage)
        self._last: dict[str, list[TransformStamped]] = {}
        self._collected: list[TransformStamped] = []

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

    def restart(self) -> None:
        """Drops all poses."""
        self._last.clear()

    def forget(self, name: str) -> None:
        """Leaves a body out from now on."""
        self._last.pop(name, None)


def joint_state_message(sample: JointStateSample, stamp_ns: int) -> JointState:
    message = JointState(
        name=sample.joint_names, position=sample.position, velocity=sample.velocity, effort=sample.effort
    )
    message.header.stamp = to_ros_time(stamp_ns)
    return message


def wrench_message(sample: WrenchSample, stamp_ns: int) -> WrenchStamped:
    message = WrenchStamped(wrench=Wrench(Vector3(*sample.force), Vector3(*sample.torque)))
    is_ours = sample.frame_id.startswith("rpbi/")
    message.header.frame_id = prefixed(sample.frame_id) if is_ours else sample.frame_id
    message.header.stamp = to_ros_time(stamp_ns)
    return message


def _transform(frame: str) -> TransformStamped:
    message = TransformStamped(child_frame_id=prefixed(frame))
    message.header.frame_id = world_frame()
    return message


TOPICS: dict[type, SampleTopic] = {
    WrenchSample: SampleTopic("rpbi/{name}/ft_sensor", WrenchStamped, wrench_message),
    JointStateSample: SampleTopic("rpbi/{name}/joint_states", JointState, joint_state_message),
    BaseStateSample: SampleTopic("rpbi/{name}/base_state", Odometry, odometry_message),
    ContactsSample: SampleTopic("rpbi/{name}/contacts", Contacts, contacts_message),
    SurfaceSample: SampleTopic("rpbi/{name}/surface", Marker, surface_message),
    ContactArrowsSample: SampleTopic("rpbi/{name}/contacts/arrows", MarkerArray, contact_arrows_message),
    ControllerState: SampleTopic(f"rpbi/{{name}}/{CONTROLLER}/state", JointTrajectoryControllerState, state_message),
}
"""The topic of each type of samples that has topics of its own."""
