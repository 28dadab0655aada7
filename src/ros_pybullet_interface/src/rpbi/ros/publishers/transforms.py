"""Publishes link poses on TF, and the static frames that the main YAML file defines."""

from collections.abc import Sequence

import rospy
from geometry_msgs.msg import Quaternion, Transform, TransformStamped, Vector3
from tf2_msgs.msg import TFMessage

from rpbi.config.world import StaticFrame
from rpbi.ros.endpoints import Topic
from rpbi.ros.headers import named_frame, prefixed, to_ros_time, world_frame
from rpbi.ros.state_topic import FastTopic
from rpbi.samples import LinkPoseSample

from .packed_messages import PackedTransforms

TF = Topic("/tf", TFMessage, meaning="Where it is, see [frames](#frames).")
TF_STATIC = Topic("/tf_static", TFMessage, meaning="Where the frames under `poses` are; latched.")


class TransformCollector:
    """Collects the link poses of a tick as transforms of one message."""

    def __init__(self) -> None:
        self._last: dict[str, list[TransformStamped]] = {}
        self._collected: list[TransformStamped] = []

    def collect(self, sample: LinkPoseSample, stamp_ns: int) -> None:
        """Adds the link poses of a body to the next TF message."""
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

    def drain(self) -> PackedTransforms | None:
        """Returns a message with the collected transforms, and clears the collection.

        Returns None if there are no transforms. The next call of `collect` overwrites the message's transforms.
        """
        collected, self._collected = self._collected, []
        return PackedTransforms(collected) if collected else None

    def last(self) -> TFMessage:
        """Returns a message with the last link poses of all bodies."""
        return TFMessage([one for body in self._last.values() for one in body])

    def restart(self) -> None:
        """Drops the stored poses of all bodies."""
        self._last.clear()

    def forget(self, name: str) -> None:
        """Drops the stored poses of a body."""
        self._last.pop(name, None)


class TransformPublisher(TransformCollector):
    """Publishes link poses on TF."""

    def __init__(self) -> None:
        super().__init__()
        self._topic = FastTopic(TF.name, TF.message_type)

    def publish(self, sample: LinkPoseSample, stamp_ns: int) -> None:
        """Collects the link poses of a body, which the next `flush` publishes."""
        self.collect(sample, stamp_ns)

    def flush(self) -> None:
        """Publishes the collected transforms, if TF has subscribers."""
        message = self.drain()
        if message is not None and self._topic.has_subscribers:
            self._topic.publish(message)

    def serve_late(self) -> None:
        """Sends the last link poses of all bodies to subscribers that have connected since the last publication."""
        self._topic.serve_late(self.last)


class StaticFrames:
    """Publishes static frames once on the latched topic /tf_static; without frames, the topic is not opened."""

    def __init__(self, poses: Sequence[StaticFrame]) -> None:
        if poses:
            self._publisher = rospy.Publisher(TF_STATIC.name, TF_STATIC.message_type, queue_size=1, latch=True)
            self._publisher.publish(static_frames_message(poses))


def static_frames_message(poses: Sequence[StaticFrame]) -> TFMessage:
    """Converts static frames to a message with their transforms."""
    return TFMessage([_static_transform(each) for each in poses])


def _transform(frame: str) -> TransformStamped:
    message = TransformStamped(child_frame_id=prefixed(frame))
    message.header.frame_id = world_frame()
    return message


def _static_transform(frame: StaticFrame) -> TransformStamped:
    position, quat = frame.pose
    message = TransformStamped(child_frame_id=named_frame(frame.tf_id))
    message.header.frame_id = named_frame(frame.parent)
    message.transform = Transform(Vector3(*position), Quaternion(*quat))
    return message
