"""Topics that carry the state of the world."""

from collections import deque
from collections.abc import Callable
from typing import Any

import rospy

from custom_ros_tools.ros.rospy_internals import DirectSending, close_poller_with

QUEUE_SIZE = 1000
"""Messages kept for a slow subscriber before its oldest are dropped: it never holds physics up."""


class StateTopic(rospy.SubscribeListener):
    """A topic whose last message can be sent to new subscribers while the world is stopped.

    A stopped world in simulated time has nothing new, and publishing again would repeat stamps; a late subscriber is
    therefore served alone. One thread at a time publishes and serves. Up to `queue_size` messages are buffered for each
    subscriber, the oldest dropped; with None, publishing waits until each is sent.
    """

    def __init__(self, topic: str, message_type: type, queue_size: int | None = QUEUE_SIZE) -> None:
        super().__init__()
        self._late: deque[Callable[[Any], None]] = deque()
        self._publisher = rospy.Publisher(
            topic,
            message_type,
            subscriber_listener=self,
            tcp_nodelay=True,  # else a message may wait 40 ms for the last one to be acknowledged
            queue_size=queue_size,
        )
        close_poller_with(self._publisher)

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
        """Sends the last message to subscribers that came after it."""
        while self._late:
            self._late.popleft()(last_message())

    def close(self) -> None:
        """Ends the topic."""
        self._publisher.unregister()


class FastTopic(StateTopic):
    """A topic of small messages that go out in the caller's own thread, which never waits, by `flush_buffered_sockets`.

    Messages for a slow subscriber are buffered.
    """

    def __init__(self, topic: str, message_type: type) -> None:
        super().__init__(topic, message_type)
        self._sending = DirectSending.of(self._publisher, QUEUE_SIZE)

    def wrap_connections(self) -> None:
        """Ensures that sending never waits for a subscriber, including new ones."""
        if self._sending is not None:
            self._sending.wrap_connections()

    def publish(self, message: Any) -> None:
        """Buffers a message for all subscribers until the next flush."""
        self.wrap_connections()
        super().publish(message)

    def serve_late(self, last_message: Callable[[], Any]) -> None:
        """Sends the last message to new subscribers."""
        self.wrap_connections()
        super().serve_late(last_message)
