"""Publishes the samples of a world's sensors, and defines the order of the messages of a tick."""

from collections.abc import Callable, Iterable
from functools import partial
from typing import Any

from rpbi.engine.inputs import PoseInput
from rpbi.plugins import plugin_errors, raise_plugin_error
from rpbi.ros.cameras.publisher import ScenePublisher
from rpbi.ros.endpoints import Topic
from rpbi.ros.inputs import topic_input
from rpbi.ros.state_topic import FastTopic
from rpbi.samples import LinkPoseSample, SceneSample
from rpbi.world import World

from .sample_topics import sample_topic
from .status import ClockPublisher
from .transforms import TransformPublisher

SampleKey = tuple[type, str]
"""Type and name of a sensor's samples, which identify the sensor; several sensors of a body may have the body's name.
"""


class TopicPublisher:
    """Publishes the samples of each sensor on the sensor's own topic."""

    def __init__(self) -> None:
        self._routes: dict[SampleKey, tuple[FastTopic, Callable[[Any, int], Any]]] = {}
        """The topic of each sensor, and the function that converts the sensor's samples to messages."""
        self._last: dict[SampleKey, tuple[Any, int]] = {}

    def open(self, key: SampleKey, row: Topic) -> None:
        """Advertises the topic of a sensor; any thread may call this method."""
        assert row.handler is not None  # rows of samples have one
        topic = FastTopic(row.name.format(name=key[1]), row.message_type)
        self._routes = {**self._routes, key: (topic, row.handler)}

    def publish(self, sample: Any, stamp_ns: int) -> None:
        """Publishes a sample, if its topic has subscribers.

        Raises:
            PluginError: If code of another package fails to convert the sample to a valid message.
        """
        key = type(sample), sample.name
        self._last[key] = sample, stamp_ns
        route = self._routes.get(key)  # None if the body is so new that its topics are not open yet
        if route is not None and route[0].has_subscribers:
            topic, to_message = route
            try:
                topic.publish(to_message(sample, stamp_ns))
            except Exception as error:
                raise_plugin_error(to_message, f"the message of '{sample.name}'", error)
                raise

    def serve_late(self) -> None:
        """Sends the last sample of each sensor to subscribers that have connected since that sample was published."""
        for key, (topic, to_message) in self._routes.items():
            if key in self._last:
                with plugin_errors(to_message, f"the message of '{key[1]}'"):
                    topic.serve_late(partial(to_message, *self._last[key]))

    def restart(self) -> None:
        """Drops all stored samples; the topics stay open."""
        self._last.clear()

    def forget(self, key: SampleKey) -> FastTopic | None:
        """Drops the stored sample of a sensor, and returns the sensor's topic, which the caller must close."""
        self._last.pop(key, None)
        topic, _ = self._routes.get(key, (None, None))
        self._routes = {other: route for other, route in self._routes.items() if other != key}
        return topic


class SamplePublishers:
    """Publishes all samples of a world: on topics, on TF and as camera images.

    Attributes:
        cameras: Sends the samples of cameras to the renderer process, which publishes the images.
    """

    def __init__(self, world: World) -> None:
        self._world = world
        self.cameras = ScenePublisher(world)
        self._topics, self._transforms = TopicPublisher(), TransformPublisher()
        self._elsewhere: dict[type, Any] = {LinkPoseSample: self._transforms, SceneSample: self.cameras}
        self._all = (self._topics, self._transforms, self.cameras)
        self._on_tf: dict[type, Callable[[Any, int], tuple[LinkPoseSample, int]]] = {}
        """For types of samples that also go to TF: the function that converts a sample to poses."""
        self._open: dict[str, list[SampleKey]] = {}
        """For each body whose topics are open: the keys of the body's sensors."""

    def find_topics(self, name: str) -> None:
        """Finds the topics of a body's sensors and inputs; call this method before the body's first sample.

        Raises:
            InterfaceError: If a topic that another package defines cannot be found.
        """
        for sensor in self._world.sensors_of(name):
            topic = sample_topic(sensor)
            if topic is not None and topic.on_tf is not None:
                self._on_tf[sensor.sample_type] = topic.on_tf
        for key, taken in self._world.bodies[name].inputs().items():
            if not isinstance(taken, PoseInput):
                topic_input(key, taken)

    def open(self, name: str) -> None:
        """Advertises the topics of a body's samples."""
        sensors = self._world.sensors_of(name)
        self._open[name] = [(sensor.sample_type, sensor.name) for sensor in sensors]
        for key, sensor in zip(self._open[name], sensors, strict=True):
            topic = sample_topic(sensor)
            if topic is not None:
                self._topics.open(key, topic)

    def publish(self, samples: Iterable[Any], stamp_ns: int) -> None:
        """Publishes the samples of a tick, and waits for the images of synchronous cameras.

        Raises:
            PluginError: If code of another package fails to convert a sample to a valid message.
            PhysicsError: If the image of a synchronous camera is not published in time.
        """
        for sample in samples:
            self._elsewhere.get(type(sample), self._topics).publish(sample, stamp_ns)
            on_tf = self._on_tf.get(type(sample))
            if on_tf is not None:
                self._transforms.publish(*on_tf(sample, stamp_ns))
        self._transforms.flush()
        self.cameras.flush()

    def serve_late(self) -> None:
        """Sends the last samples to subscribers that have connected since these samples were published."""
        for publisher in self._all:
            publisher.serve_late()

    def restart(self) -> None:
        """Drops all stored samples after a reset."""
        for publisher in self._all:
            publisher.restart()

    def forget(self, name: str) -> list[FastTopic]:
        """Drops the stored samples of a removed body's sensors; only the simulation thread may call this method.

        Returns:
            The body's topics. The caller must close them in another thread, since the ROS master may be slow to answer.
        """
        self.cameras.forget(name)
        keys = self._open.pop(name, [])
        for _, sensor in keys:
            self._transforms.forget(sensor)
        return [topic for topic in map(self._topics.forget, keys) if topic is not None]


class TickPublisher:
    """Publishes the time of a tick on /clock, then the samples of the tick.

    Args:
        idle_ticks: Period at which `publish_idle` is called, as a number of ticks.
    """

    def __init__(self, world: World, publishers: SamplePublishers, idle_ticks: int) -> None:
        self._world = world
        self._publishers = publishers
        self._clock = ClockPublisher(world) if world.clock.simulated else None
        self._idle_ticks = idle_ticks
        self._idle_tick = 0
        """The tick that the world would have reached by now if it had not been stopped."""

    def set_factor(self, real_time_factor: float) -> None:
        """Adapts the rate of /clock to a real-time factor; 0 is as fast as possible."""
        if self._clock is not None:
            self._clock.set_factor(real_time_factor)

    def publish_tick(self, samples: list[Any]) -> None:
        """Publishes the time and the samples of a tick; does nothing for a tick without samples."""
        if samples:
            self.publish_time()
            self._publishers.publish(samples, self._world.clock.stamp_ns)

    def publish_time(self) -> None:
        """Publishes the world's time on /clock, if the time has changed and a message is due."""
        if self._clock is not None:
            self._clock.publish_tick()

    def publish_all(self, samples: list[Any]) -> None:
        """Publishes the last tick before a stop: the time and the samples of all sensors, due or not.

        Args:
            samples: Samples of the sensors that were due; this method reads the other sensors.
        """
        self.publish_last_time()
        self._publishers.publish(samples + self._world.read_rest(), self._world.clock.stamp_ns)

    def publish_last_time(self) -> None:
        """Publishes the time of the last tick before a stop, without samples; also works after the world has failed."""
        self._idle_tick = self._world.clock.tick
        if self._clock is not None:
            self._clock.publish_now()

    def repeat_time(self) -> None:
        """Publishes the time of a stopped world again, so that later subscribers receive it too."""
        if self._clock is not None:
            self._clock.repeat()

    def publish_idle(self) -> None:
        """Publishes the samples of a stopped world, without sending a subscriber two samples with the same stamp.

        If stamps are simulated time, this method reads and publishes sensors that were not read at this tick, and sends
        the last samples to new subscribers. If stamps are wall time, sensors are published at their rates with new
        stamps.
        """
        if self._clock is not None:
            self._publishers.publish(self._world.read_rest(), self._world.clock.stamp_ns)
            self._publishers.serve_late()
        else:
            since, self._idle_tick = self._idle_tick, self._idle_tick + self._idle_ticks
            self._world.clock.restamp()
            self._publishers.publish(self._world.read_idle(self._idle_tick, since), self._world.clock.stamp_ns)

    def restart(self) -> None:
        """Drops samples from before a reset, and publishes the time and all samples of the present state."""
        self._publishers.restart()
        self.publish_all([])
