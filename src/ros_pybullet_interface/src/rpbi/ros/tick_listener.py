"""Waits for the messages of a tick, for programs that step a world."""

import threading
import time
from collections.abc import Mapping
from typing import Any

import genpy
import rospy


class TickListener:
    """Keeps the newest message of each of some topics, and waits for those of a tick.

    Services and topics are different sockets: the answer to `rpbi/step_n` may be there before the messages of its last
    tick. It works with ROS time that stands still, too, since it waits by the wall clock.

    Args:
        topics: Types of messages by topic; each has a header.
    """

    def __init__(self, topics: Mapping[str, type]) -> None:
        self._changed = threading.Condition()
        self._newest: dict[str, Any] = {}
        self._subscribers = {
            topic: rospy.Subscriber(topic, message_type, self._on_message, topic, queue_size=1000, tcp_nodelay=True)
            for topic, message_type in topics.items()
        }

    def wait_for_tick(self, stamp: genpy.Time, timeout_s: float = 5.0) -> dict[str, Any]:
        """Waits for messages of a tick or later on all topics, and returns the newest of each.

        Args:
            stamp: Stamp of the tick, as `rpbi/step_n` returns it.
            timeout_s: Longest wait [s] of wall time.

        Raises:
            TimeoutError: If topics have no such message; it names them.
        """
        end_s = time.monotonic() + timeout_s
        with self._changed:
            while late := [topic for topic in self._subscribers if not self._has(topic, stamp)]:
                left_s = end_s - time.monotonic()
                if left_s <= 0.0 or rospy.is_shutdown():
                    raise TimeoutError(f"nothing with stamp {stamp.to_sec():.9f} or later came on {', '.join(late)}")
                self._changed.wait(min(left_s, 0.5))
            return dict(self._newest)

    def close(self) -> None:
        """Unsubscribes."""
        for subscriber in self._subscribers.values():
            subscriber.unregister()

    def _has(self, topic: str, stamp: genpy.Time) -> bool:
        return topic in self._newest and self._newest[topic].header.stamp >= stamp

    def _on_message(self, message: Any, topic: str) -> None:
        with self._changed:
            self._newest[topic] = message
            self._changed.notify_all()
