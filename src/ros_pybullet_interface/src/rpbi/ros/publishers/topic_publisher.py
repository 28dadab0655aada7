"""Where samples go: one publisher for each type of samples."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

from rpbi.plugins import blame, blaming

from .sample_topics import SampleTopic
from .topics import FastTopic


class SamplePublisher(Protocol):
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


class _Route(NamedTuple):
    """Where the samples of one sensor go."""

    topic: FastTopic
    to_message: Callable[[Any, int], Any]


class TopicPublisher:
    """Samples of one type, each sensor on a topic of its own."""

    def __init__(self) -> None:
        self._routes: dict[str, _Route] = {}
        self._last: dict[str, tuple[Any, int]] = {}

    def open(self, name: str, sample_topic: SampleTopic) -> None:
        """Advertises the topic of a sensor; any thread may call it."""
        topic = FastTopic(sample_topic.topic.format(name=name), sample_topic.message_type)
        self._routes = {**self._routes, name: _Route(topic, sample_topic.to_message)}

    def publish(self, sample: Any, stamp_ns: int) -> None:
        """Sends a sample.

        Raises:
            PluginError: If another package makes no message of it that can be sent.
        """
        self._last[sample.name] = sample, stamp_ns
        route = self._routes.get(sample.name)  # there is none as long as the body is new
        if route is not None and route.topic.has_subscribers:
            try:
                route.topic.publish(route.to_message(sample, stamp_ns))
            except Exception as error:
                blame(route.to_message, f"the message of '{sample.name}'", error)
                raise

    def flush(self) -> None:
        """Has nothing to send: each sensor has a topic of its own."""

    def serve_late(self) -> None:
        """Gives the last samples to who has come since."""
        for name, (topic, to_message) in self._routes.items():
            if name in self._last:
                with blaming(to_message, f"the message of '{name}'"):
                    topic.serve_late(lambda last=self._last[name], make=to_message: make(*last))

    def restart(self) -> None:
        """Drops what it keeps of all samples; the topics stay."""
        self._last.clear()

    def forget(self, name: str) -> FastTopic | None:
        """Drops what it keeps of a sensor.

        Returns:
            Its topic. Closing it is left to another thread, since the ROS master may be slow to answer.
        """
        self._last.pop(name, None)
        routes = dict(self._routes)
        route = routes.pop(name, None)
        self._routes = routes
        return None if route is None else route.topic
