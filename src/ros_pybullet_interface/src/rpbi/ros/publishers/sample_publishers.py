"""The publishers of a world: which topics a body has among them, and the order in which a tick goes out."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rpbi.engine.inputs import PoseInput
from rpbi.ros.cameras.publisher import ScenePublisher
from rpbi.ros.inputs import topic_input
from rpbi.samples import LinkPoseSample, SceneSample
from rpbi.world import World

from .sample_topics import TOPICS, sample_topic
from .status import ClockPublisher
from .topic_publisher import SamplePublisher, TopicPublisher, TransformPublisher
from .topics import FastTopic


class SamplePublishers:
    """All publishers of a world.

    Args:
        world: The world.

    Attributes:
        cameras: That of the images.
        by_type: All of them by type of sample; more come with bodies that other packages add.
    """

    def __init__(self, world: World) -> None:
        self._world = world
        self._topics = {sample_type: TopicPublisher() for sample_type in TOPICS}
        self._fed: dict[str, list[tuple[SamplePublisher, str]]] = {}
        """The publishers and sensors of each body whose topics are open."""
        self.cameras = ScenePublisher(world)
        self.by_type: dict[type, SamplePublisher] = {
            **self._topics,
            LinkPoseSample: TransformPublisher(),
            SceneSample: self.cameras,
        }

    def find_topics(self, name: str) -> None:
        """Finds the topics of a body before its first sample, those that other packages name too.

        Raises:
            InterfaceError: If there is one that cannot be found.
        """
        for sensor in self._world.sensors_of(name):
            if sample_topic(sensor) is not None and sensor.sample_type not in self._topics:
                self._topics[sensor.sample_type] = self.by_type[sensor.sample_type] = TopicPublisher()
        for key, taken in self._world.bodies[name].inputs().items():
            if not isinstance(taken, PoseInput):
                topic_input(key, taken)

    def open(self, name: str) -> None:
        """Opens the topics of a body's samples."""
        sensors = self._world.sensors_of(name)
        self._fed[name] = [(self.by_type[sensor.sample_type], sensor.name) for sensor in sensors]
        for sensor in sensors:
            topic = sample_topic(sensor)
            if topic is not None:
                self._topics[sensor.sample_type].open(sensor.name, topic)

    def forget(self, name: str) -> list[FastTopic]:
        """Drops what is kept of a body that has gone, and of its sensors; for the simulation thread.

        Returns:
            The topics that are left to close, by another thread.
        """
        self.cameras.forget(name)
        topics = [publisher.forget(sensor) for publisher, sensor in self._fed.pop(name, [])]
        return [topic for topic in topics if topic is not None]


class TickPublisher:
    """Publishes everything of a tick: the time first, then the samples.

    Args:
        world: The world.
        publishers: Where samples go, one for each type of sample; there may be more later.
        clock: Publishes /clock if stamps are simulated time.
        idle_ticks: How many ticks pass between two calls of `publish_idle` were the world running.
    """

    def __init__(
        self, world: World, publishers: Mapping[type, SamplePublisher], clock: ClockPublisher | None, idle_ticks: int
    ) -> None:
        self._world = world
        self._publishers = publishers
        self._clock = clock
        self._idle_ticks = idle_ticks
        self._idle_tick = 0
        """The tick at which the world would be, had it not stood still."""

    def publish_tick(self, samples: list[Any]) -> None:
        """Publishes a tick and the samples that were due."""
        if self._clock is not None:
            self._clock.publish_tick()
        if samples:
            self._publish(samples)

    def publish_all(self, samples: list[Any]) -> None:
        """Publishes the last tick before standing still: all of it, whatever is due."""
        self.publish_last_time()
        self._publish(samples + self._world.read_rest())

    def publish_last_time(self) -> None:
        """Publishes the time of the last tick before standing still, and nothing of a world that may be broken."""
        self._idle_tick = self._world.clock.tick
        if self._clock is not None:
            self._clock.publish_now()

    def repeat_time(self) -> None:
        """Repeats the time for those who come late."""
        if self._clock is not None:
            self._clock.repeat()

    def publish_idle(self) -> None:
        """Keeps a world that stands still visible to those who come late, without repeating a stamp."""
        if self._clock is not None:
            self._publish(self._world.read_rest())
            for publisher in self._publishers.values():
                publisher.serve_late()
        else:
            since, self._idle_tick = self._idle_tick, self._idle_tick + self._idle_ticks
            self._world.clock.restamp()
            self._publish(self._world.read_idle(self._idle_tick, since))

    def restart(self) -> None:
        """Drops what is kept of a world before its reset, and publishes how it is now."""
        for publisher in self._publishers.values():
            publisher.restart()
        self.publish_all([])

    def _publish(self, samples: list[Any]) -> None:
        stamp_ns = self._world.clock.stamp_ns
        for sample in samples:
            self._publishers[type(sample)].publish(sample, stamp_ns)
        for publisher in self._publishers.values():
            publisher.flush()
