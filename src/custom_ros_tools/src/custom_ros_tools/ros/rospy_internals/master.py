"""Replaces rospy's handling of registrations and reported publishers, and sets cached parameters."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from itertools import count
from typing import Any

import rospy

from .expecting import expecting


class Subscriptions:
    """Connects the subscriptions of this node to all publishers that the ROS master has reported.

    rospy itself has two faults. First, it only handles the last report about each topic, although reports may arrive
    out of order. Second, it counts closed connections, and therefore does not reconnect after a connection is lost.

    Args:
        manager: rospy's object that receives the reports. The new `Subscriptions` object receives them instead.
        topics: rospy's topic manager.
    """

    def __init__(self, manager: Any, topics: Any) -> None:
        self._topics, self._connect_topic = topics, manager.handler._connect_topic
        self._lock = threading.Lock()
        self._reports = count()
        self._reported: dict[tuple[str, str], int] = {}
        """Number of the last report about each pair of topic and publisher address."""
        self._connecting: set[tuple[str, str]] = set()
        if not callable(manager.publisher_update):
            raise TypeError("RegManager.publisher_update is no method")
        manager.publisher_update = self.on_report

    def on_report(self, topic: str, publishers: list[str]) -> None:
        """Connects a subscription to the publishers in a report of the master. Existing connections are kept.

        Args:
            topic: Name of the topic.
            publishers: Addresses (URIs) of the publishers' nodes.
        """
        with self._lock:
            self._reported.update({(topic, uri): next(self._reports) for uri in publishers})
        self.connect_missing()

    def connect_missing(self) -> None:
        """Connects to all reported publishers without a connection, in new threads; does not wait for the threads."""
        with self._lock:
            missing = [pair for pair in self._reported if pair not in self._connecting and not self._has(*pair)]
            self._connecting.update(missing)
        for pair in missing:
            threading.Thread(target=self._connect, args=pair, daemon=True).start()

    def _has(self, topic: str, uri: str) -> bool:
        subscription = self._topics.get_subscriber_impl(topic)
        if subscription is None:
            return False
        for connection in getattr(subscription, "connections", ()):  # without a list, closed ones stay
            if connection.done:
                subscription.remove_connection(connection)
        return bool(subscription.has_connection(uri))

    def _connect(self, topic: str, uri: str) -> None:
        """Connects to a publisher. If the publisher refuses, does not retry before the master reports it again."""
        pair, code = (topic, uri), 0
        report = self._reported.get(pair)
        try:
            code, *_ = self._connect_topic(topic, uri)
        except Exception:
            is_left = self._topics.get_subscriber_impl(topic) is None  # the node unsubscribed in the meantime
            if not is_left and not rospy.core.is_shutdown_requested():  # otherwise, errors are expected
                raise
        finally:
            with self._lock:
                self._connecting.discard(pair)
                if code != 1 and self._reported.get(pair) == report:
                    self._reported.pop(pair, None)


class Registry:
    """Access to the topics and services of this node in rospy.

    Attributes:
        subscriptions: Object that connects the node to the publishers of its topics.
    """

    def __init__(self) -> None:
        registration = import_module("rospy.impl.registration")
        self._topics, self._services = registration.get_topic_manager(), registration.get_service_manager()
        self._listeners = registration.get_registration_listeners()
        (self._rospys,) = (each for each in self._listeners.listeners if isinstance(each, registration.RegManager))
        kinds = registration.Registration
        if (kinds.SUB, kinds.PUB, kinds.SRV) != ("sub", "pub", "srv"):
            raise TypeError("other kinds of registrations")
        with self.entries():
            pass  # tests at the start that `entries` works
        self.subscriptions = Subscriptions(self._rospys, self._topics)
        rospy.core.add_shutdown_hook(lambda _: self._wake())  # otherwise rospy waits up to 0.5 s for its thread

    @contextmanager
    def entries(self) -> Iterator[list[tuple[str, str, str]]]:
        """Context that yields all topics and services, and prevents changes to them.

        Each entry has three texts: kind (`sub`, `pub` or `srv`), name, and type of the topic or address of the service.
        """
        with self._topics.lock, self._services.lock:
            yield [
                *(("sub", *each) for each in self._topics.get_subscriptions()),
                *(("pub", *each) for each in self._topics.get_publications()),
                *(("srv", *each) for each in self._services.get_services()),
            ]

    def _wake(self) -> None:
        with self._rospys.cond:
            self._rospys.cond.notify_all()

    def hand_over(self, listener: Any) -> None:
        """Makes rospy call a given object for registrations, instead of rospy's own object.

        Args:
            listener: Object with the methods `reg_added` and `reg_removed`, such as `Registrations`.
        """
        with self._listeners.lock:
            self._listeners.listeners[self._listeners.listeners.index(self._rospys)] = listener


def registry() -> Registry | None:
    """Makes the registry of this node. If rospy has unexpected internals, logs a warning and returns None."""
    return expecting(
        "rospy.impl.registration to have RegManager among its listeners",
        "a restarted ROS master will not know this node: restart the node then",
        Registry,
    )


def answer_cached(parameter: str, value: Any) -> None:
    """Stores a parameter in rospy's cache, so that `rospy.get_param_cached` does not contact the master."""
    expecting(
        "rospy.impl.paramserver to have a cache",
        "logging blocks while the master hangs",
        lambda: import_module("rospy.impl.paramserver").get_param_server_cache().set(parameter, value),
    )
