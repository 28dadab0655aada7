"""Topics that carry the state of the world."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any

import rospy

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
        self._publisher = rospy.Publisher(topic, message_type, subscriber_listener=self, queue_size=queue_size)

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
