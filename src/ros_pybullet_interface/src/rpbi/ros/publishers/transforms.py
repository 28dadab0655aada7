"""Transforms on TF: poses of links, and frames of the main file."""

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
    """Link poses as transforms, all that a tick has in one message."""

    def __init__(self) -> None:
        self._last: dict[str, list[TransformStamped]] = {}
        self._collected: list[TransformStamped] = []

    def collect(self, sample: LinkPoseSample, stamp_ns: int) -> None:
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

    def drain(self) -> PackedTransforms | None:
        """Returns what was collected, valid until the next sample; None if that is nothing."""
        collected, self._collected = self._collected, []
        return PackedTransforms(collected) if collected else None

    def last(self) -> TFMessage:
        """Returns the last poses of all bodies."""
        return TFMessage([one for body in self._last.values() for one in body])

    def restart(self) -> None:
        """Drops all poses."""
        self._last.clear()

    def forget(self, name: str) -> None:
        """Drops the poses of a body."""
        self._last.pop(name, None)


class TransformPublisher(TransformCollector):
    """Link poses on TF."""

    def __init__(self) -> None:
        super().__init__()
        self._topic = FastTopic(TF.name, TF.message_type)

    def publish(self, sample: LinkPoseSample, stamp_ns: int) -> None:
        """Collects the transforms of a body for the next `flush`."""
        self.collect(sample, stamp_ns)

    def flush(self) -> None:
        """Sends what was collected."""
        message = self.drain()
        if message is not None and self._topic.has_subscribers:
            self._topic.publish(message)

    def serve_late(self) -> None:
        """Sends all last poses to new subscribers."""
        self._topic.serve_late(self.last)


class StaticFrames:
    """Puts frames on TF once and for all; without any there is no topic."""

    def __init__(self, poses: Sequence[StaticFrame]) -> None:
        if poses:
            self._publisher = rospy.Publisher(TF_STATIC.name, TF_STATIC.message_type, queue_size=1, latch=True)
            self._publisher.publish(static_frames_message(poses))


def static_frames_message(poses: Sequence[StaticFrame]) -> TFMessage:
    """Returns frames with their poses as transforms."""
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
