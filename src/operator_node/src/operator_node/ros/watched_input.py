"""A topic of people's input, and whether more is to be expected."""

import time
from collections.abc import Callable
from typing import Any

import rospy

QUEUE_SIZE = 10
"""Old input is of no use to anybody."""


class WatchedInput:
    """Subscribes to a topic, and knows when its input has ceased.

    It has when nobody publishes the topic any more, since nothing more can come, or when nothing has come for too long.

    Args:
        topic: The topic.
        message_type: Its type.
        take: Called with each message.
        timeout_s: How long is too long [s]; 0 is never.
    """

    def __init__(self, topic: str, message_type: type, take: Callable[[Any], None], timeout_s: float = 0.0) -> None:
        self._take, self._timeout_s = take, timeout_s
        self._last_s: float | None = None
        self._subscriber = rospy.Subscriber(topic, message_type, self._note, queue_size=QUEUE_SIZE, tcp_nodelay=True)

    @property
    def topic(self) -> str:
        """Full name of the topic."""
        return str(self._subscriber.resolved_name)

    def silence(self) -> str:
        """Returns why its input has ceased; empty if it has not, or has not begun yet."""
        if self._last_s is None:
            return ""
        if self._subscriber.get_num_connections() == 0:
            return "nobody publishes it any more"
        if self._timeout_s and time.monotonic() - self._last_s > self._timeout_s:
            return f"nothing has come for {self._timeout_s:g} s"
        return ""

    def _note(self, message: Any) -> None:
        self._last_s = time.monotonic()
        self._take(message)
