"""Topics that carry the state of the world."""

from __future__ import annotations

import socket
from collections import deque
from collections.abc import Callable
from typing import Any

import rospy

from .buffered_socket import BufferedSocket

QUEUE_SIZE = 1000
"""Messages kept for a slow subscriber before its oldest are dropped: it never holds physics up."""


class StateTopic(rospy.SubscribeListener):
    """A topic whose last message can be given to subscribers that come while the world stands still.

    A stopped world in simulated time says nothing new, and saying the same again would repeat stamps; so who comes
    late is served alone.

    Args:
        topic: Name of the topic.
        message_type: Its ROS type.
        queue_size: Messages kept for each subscriber.
    """

    def __init__(self, topic: str, message_type: type, queue_size: int = QUEUE_SIZE) -> None:
        super().__init__()
        self._late: deque[Callable[[Any], None]] = deque()
        self._publisher = rospy.Publisher(
            topic,
            message_type,
            subscriber_listener=self,
            tcp_nodelay=True,  # else a message may wait 40 ms for the last one to be acknowledged
            queue_size=queue_size,
        )

    def peer_subscribe(self, topic_name: str, topic_publish: Any, peer_publish: Callable[[Any], None]) -> None:
        """Notes a new subscriber; rospy calls it from a thread of its own."""
        self._late.append(peer_publish)

    @property
    def has_subscribers(self) -> bool:
        """Whether anybody listens; if not, no message need be built."""
        return self._publisher.get_num_connections() > 0

    def publish(self, message: Any) -> None:
        """Sends a message to all subscribers."""
        self._late.clear()
        self._publisher.publish(message)

    def serve_late(self, last_message: Callable[[], Any]) -> None:
        """Gives the last message to the subscribers that have come since it was published."""
        while self._late:
            peer_publish = self._late.popleft()
            with self._publisher.impl.publock:
                peer_publish(last_message())

    def close(self) -> None:
        """Ends the topic."""
        self._publisher.unregister()


class FastTopic(StateTopic):
    """A topic of small messages that go out in the caller's own thread, which never waits.

    With a queue size, rospy hands every message to a thread for each subscriber. At 1 kHz with a few subscribers the
    threads' quarrel about Python's lock costs more than the simulation; without a queue size, one subscriber that does
    not read stops everybody. So here rospy sends at once, through sockets that keep what is not taken yet. It is not
    for images, whose rest would wait for the next one.
    """

    def __init__(self, topic: str, message_type: type, queue_size: int = QUEUE_SIZE) -> None:
        super().__init__(topic, message_type, queue_size)
        self._queue_size = queue_size
        self._connections: Any = None
        self._publisher.impl.set_queue_size(None)

    def publish(self, message: Any) -> None:
        """Sends a message to all subscribers, or keeps it for those that are slow."""
        self.wrap_connections()
        super().publish(message)

    def wrap_connections(self) -> None:
        """Sees to it that sending never waits for anybody, not for those either that have just come."""
        connections = self._publisher.impl.connections  # rospy makes a new list whenever somebody comes or goes
        if connections is not self._connections:
            for connection in connections:
                if isinstance(connection.socket, socket.socket):
                    connection.socket = BufferedSocket(connection.socket, self._queue_size)
            self._connections = connections

    def flush(self) -> None:
        """Sends what slow subscribers have not taken yet; for a time in which nothing new is published."""
        for connection in self._publisher.impl.connections:
            if isinstance(connection.socket, BufferedSocket):
                try:
                    connection.socket.flush()
                except OSError:
                    connection.close()

    def serve_late(self, last_message: Callable[[], Any]) -> None:
        """Gives the last message to who has come since, and the rest to who was slow."""
        super().serve_late(last_message)
        self.flush()
