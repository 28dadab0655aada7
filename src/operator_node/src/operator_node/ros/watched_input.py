"""A topic of people's input, and whether more is to be expected."""

import time
from collections.abc import Callable
from typing import Any

import rospy

from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning

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
        self._warn = ThrottledWarning()
        self._subscriber = rospy.Subscriber(topic, message_type, self._note, queue_size=QUEUE_SIZE, tcp_nodelay=True)

    @property
    def topic(self) -> str:
        """Full name of the topic."""
        return str(self._subscriber.resolved_name)

    def has_ceased(self, consequence: str) -> bool:
        """Returns whether its input has ceased, which it has not before it began; if so, warns of a consequence."""
        if self._last_s is None:
            return False
        if self._subscriber.get_num_connections() == 0:
            reason = "nobody publishes it any more"
        elif self._timeout_s and time.monotonic() - self._last_s > self._timeout_s:
            reason = f"nothing has come for {self._timeout_s:g} s"
        else:
            return False
        self._warn(self.topic, f"{reason}: {consequence}")
        return True

    def _note(self, message: Any) -> None:
        self._last_s = time.monotonic()
        self._take(message)
