"""Publishers of samples: a topic for each sensor, and TF for poses of links."""

from collections.abc import Callable
from functools import partial
from typing import Any

from geometry_msgs.msg import TransformStamped
from tf2_msgs.msg import TFMessage

from rpbi.plugins import plugin_errors, raise_plugin_error
from rpbi.ros.endpoints import Topic
from rpbi.ros.headers import prefixed, to_ros_time, world_frame
from rpbi.ros.messages.topics import FastTopic
from rpbi.samples import LinkPoseSample

from .packed_messages import PackedTransforms

TF = Topic("/tf", TFMessage, meaning="Where it is, see [frames](#frames).")


SampleKey = tuple[type, str]
"""Type and name of the samples of a sensor: sensors of a body may have its name."""


class TopicPublisher:
    """Samples of sensors, each on a topic of its own."""

    def __init__(self) -> None:
        self._routes: dict[SampleKey, tuple[FastTopic, Callable[[Any, int], Any]]] = {}
        """The topic of each sensor, and what makes its messages."""
        self._last: dict[SampleKey, tuple[Any, int]] = {}

    def open(self, key: SampleKey, row: Topic) -> None:
        """Advertises the topic of a sensor; any thread may call it."""
        assert row.handler is not None  # rows of samples have one
        topic = FastTopic(row.name.format(name=key[1]), row.message_type)
        self._routes = {**self._routes, key: (topic, row.handler)}

    def publish(self, sample: Any, stamp_ns: int) -> None:
        """Sends a sample.

        Raises:
            PluginError: If another package makes no message of it that can be sent.
        """
        key = type(sample), sample.name
        self._last[key] = sample, stamp_ns
        route = self._routes.get(key)  # no such stream as long as the body is new
        if route is not None and route[0].has_subscribers:
            topic, to_message = route
            try:
                topic.publish(to_message(sample, stamp_ns))
            except Exception as error:
                raise_plugin_error(to_message, f"the message of '{sample.name}'", error)
                raise

    def serve_late(self) -> None:
        """Sends the last samples to new subscribers."""
        for key, (topic, to_message) in self._routes.items():
            if key in self._last:
                with plugin_errors(to_message, f"the message of '{key[1]}'"):
                    topic.serve_late(partial(to_message, *self._last[key]))

    def restart(self) -> None:
        """Drops all stored samples; the topics stay open."""
        self._last.clear()

    def forget(self, key: SampleKey) -> FastTopic | None:
        """Drops the stored samples of a sensor; returns its topic, which the caller closes."""
        self._last.pop(key, None)
        topic, _ = self._routes.get(key, (None, None))
        self._routes = {other: route for other, route in self._routes.items() if other != key}
        return topic


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


def _transform(frame: str) -> TransformStamped:
    message = TransformStamped(child_frame_id=prefixed(frame))
    message.header.frame_id = world_frame()
    return message
