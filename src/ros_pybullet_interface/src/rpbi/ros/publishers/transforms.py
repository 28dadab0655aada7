"""Poses of links, on TF."""

from __future__ import annotations

from geometry_msgs.msg import TransformStamped
from tf2_msgs.msg import TFMessage

from rpbi.ros.headers import prefixed, to_ros_time, world_frame
from rpbi.samples import LinkPoseSample

from .topics import FastTopic


class TransformPublisher:
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
        """Leaves out what a sensor told, from now on."""
        self._last.pop(name, None)


def _transform(frame: str) -> TransformStamped:
    message = TransformStamped(child_frame_id=prefixed(frame))
    message.header.frame_id = world_frame()
    return message
