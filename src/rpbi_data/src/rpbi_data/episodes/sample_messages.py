"""Converts a world's sensor samples to the messages that the simulator node publishes, without a ROS master."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any

from rpbi.plugins import plugin_errors
from rpbi.ros.endpoints import Topic
from rpbi.ros.publishers.sample_publishers import SampleKey
from rpbi.ros.publishers.sample_topics import sample_topic
from rpbi.ros.publishers.transforms import TF, TransformCollector
from rpbi.samples import LinkPoseSample, SceneSample
from rpbi.world import World


class SampleMessages:
    """Converts samples of sensors to messages. Samples of cameras are skipped, since the renderer draws their images.

    Args:
        world: The world.
        is_wanted: Function that returns, for a topic's name without namespace, whether the topic's messages are needed.
    """

    def __init__(self, world: World, is_wanted: Callable[[str], bool]) -> None:
        self._world, self._is_wanted = world, is_wanted
        self._routes: dict[SampleKey, Topic | None] = {}
        """Topic of each sensor, indexed by sample type and sensor name; None if its messages are not needed."""
        self._transforms = TransformCollector()

    def of(self, samples: Iterable[Any], stamp_ns: int) -> Iterator[tuple[str, Any]]:
        """Yields topics and messages for samples with a given stamp [ns]. The last message contains all link poses."""
        for sample in samples:
            if isinstance(sample, LinkPoseSample):
                self._transforms.collect(sample, stamp_ns)
            elif not isinstance(sample, SceneSample):
                yield from self._message(sample, stamp_ns)
        if (transforms := self._transforms.drain()) is not None:
            yield TF.name, transforms

    def keeps_state(self, topic: str) -> bool:
        """Returns whether the sensor of a topic has an internal state, such as a zero offset or a moving average."""
        return any(each.keeps_state for each in self._sensors() if self._name(each, sample_topic(each)) == topic)

    def _message(self, sample: Any, stamp_ns: int) -> Iterator[tuple[str, Any]]:
        topic = self._topic(sample)
        if topic is not None and topic.handler is not None:
            with plugin_errors(topic.handler, f"the message of '{sample.name}'"):
                message = topic.handler(sample, stamp_ns)
            yield topic.name.format(name=sample.name), message
            if topic.on_tf is not None:
                self._transforms.collect(*topic.on_tf(sample, stamp_ns))

    def _topic(self, sample: Any) -> Topic | None:
        """Returns the topic of a sample's sensor; None if the sensor has no topic, or the topic is not needed."""
        key = type(sample), sample.name
        if key not in self._routes:
            for sensor in self._sensors():
                topic = sample_topic(sensor)
                is_wanted = topic is not None and self._is_wanted(self._name(sensor, topic))
                self._routes[sensor.sample_type, sensor.name] = topic if is_wanted else None
        return self._routes.get(key)

    def _sensors(self) -> Iterator[Any]:
        return (sensor for name in self._world.bodies for sensor in self._world.sensors_of(name))

    def _name(self, sensor: Any, topic: Topic | None) -> str:
        return "" if topic is None else topic.name.format(name=sensor.name)
