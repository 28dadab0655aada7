"""Waits for the messages of a tick, for ROS nodes that step a world."""

import threading
import time
from collections.abc import Mapping
from typing import Any

import genpy
import rospy


class TickListener:
    """Subscribes to topics, stores the newest message of each, and waits for the messages of a given tick.

    Services and topics use different sockets, so the answer of `rpbi/step_n` may arrive before the messages of the last
    tick. Timeouts use the wall clock, and therefore also work while ROS time is stopped.

    Args:
        topics: Message types, indexed by topic; each type must have a header.
    """

    def __init__(self, topics: Mapping[str, type]) -> None:
        self._changed = threading.Condition()
        self._newest: dict[str, Any] = {}
        self._subscribers = {
            topic: rospy.Subscriber(topic, message_type, self._on_message, topic, queue_size=1000, tcp_nodelay=True)
            for topic, message_type in topics.items()
        }

    def wait_for_tick(self, stamp: genpy.Time, timeout_s: float = 5.0) -> dict[str, Any]:
        """Waits until every topic has a message of the given tick or a later one.

        Args:
            stamp: Stamp of the tick, as returned by `rpbi/step_n`.
            timeout_s: Maximum wait [s] of wall time.

        Returns:
            The newest message of each topic, indexed by topic.

        Raises:
            TimeoutError: If a topic has no such message in time; the error names all such topics.
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
        """Unsubscribes from all topics."""
        for subscriber in self._subscribers.values():
            subscriber.unregister()

    def _has(self, topic: str, stamp: genpy.Time) -> bool:
        return topic in self._newest and self._newest[topic].header.stamp >= stamp

    def _on_message(self, message: Any, topic: str) -> None:
        with self._changed:
            self._newest[topic] = message
            self._changed.notify_all()
