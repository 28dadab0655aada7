"""The publishers of a world's samples, and which topics a body has among them."""

from __future__ import annotations

from rpbi.engine.inputs import PoseInput
from rpbi.ros.cameras.publisher import ScenePublisher
from rpbi.ros.inputs import topic_input
from rpbi.samples import LinkPoseSample, SceneSample
from rpbi.world import World

from .sample_topics import TOPICS, sample_topic
from .topic_publisher import SamplePublisher, TopicPublisher
from .topics import FastTopic
from .transforms import TransformPublisher


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
