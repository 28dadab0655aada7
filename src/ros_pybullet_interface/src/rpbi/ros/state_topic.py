"""Topics that carry the state of the world."""

from collections import deque
from collections.abc import Callable
from typing import Any

import rospy

from custom_ros_tools.ros.rospy_internals import DirectSending, close_poller_with

QUEUE_SIZE = 1000
"""Largest number of messages buffered for a slow subscriber; beyond it, the oldest are dropped, so that physics never
waits for a subscriber."""


class StateTopic(rospy.SubscribeListener):
    """A topic whose last message can be sent to new subscribers while the world is stopped.

    A stopped world in simulated time has no new messages. Publishing the last message again would send the same stamp
    twice to old subscribers, so `serve_late` sends the last message to new subscribers only. `publish` and `serve_late`
    must not run in two threads at once.

    Args:
        queue_size: Maximum number of messages buffered for each subscriber; further messages replace the oldest ones.
            With None, `publish` waits until the message is sent.
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
        """Stores a new subscriber for `serve_late`; rospy calls this method in another thread."""
        self._late.append(peer_publish)

    @property
    def has_subscribers(self) -> bool:
        """Whether the topic has subscribers; without them, callers need not build messages."""
        return self._publisher.get_num_connections() > 0

    def publish(self, message: Any) -> None:
        """Sends a message to all subscribers."""
        self._late.clear()
        self._publisher.publish(message)

    def serve_late(self, last_message: Callable[[], Any]) -> None:
        """Calls `last_message`, and sends the result to subscribers that have connected since the last `publish`."""
        while self._late:
            self._late.popleft()(last_message())

    def close(self) -> None:
        """Unregisters the topic."""
        self._publisher.unregister()


class FastTopic(StateTopic):
    """A topic for small messages: `publish` buffers messages, and `flush_buffered_sockets` sends them.

    `flush_buffered_sockets` sends in the calling thread. Neither function waits for a slow subscriber.
    """

    def __init__(self, topic: str, message_type: type) -> None:
        super().__init__(topic, message_type)
        self._sending = DirectSending.of(self._publisher, QUEUE_SIZE)

    def wrap_connections(self) -> None:
        """Wraps the connections opened since the last call, so that sending never waits for a subscriber."""
        if self._sending is not None:
            self._sending.wrap_connections()

    def publish(self, message: Any) -> None:
        """Buffers a message for all subscribers until the next flush."""
        self.wrap_connections()
        super().publish(message)

    def serve_late(self, last_message: Callable[[], Any]) -> None:
        """Wraps connections, and then does the same as `StateTopic.serve_late`."""
        self.wrap_connections()
        super().serve_late(last_message)
