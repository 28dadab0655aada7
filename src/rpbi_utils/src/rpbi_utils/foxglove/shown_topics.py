"""Offers the topics of a ROS system to viewers, and passes their messages on as bytes while a viewer wants them."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from typing import Any

import rospy

from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning
from custom_ros_tools.ros.topic_table import UNKNOWN_TYPE, TopicRow, TopicTable

from .type_messages import TypeDefinition, ask_publishers, installed_message
from .viewer_server import Viewers

ASK_AGAIN_S = 10.0
"""Time until the publishers of a topic with an unknown type are asked again [s]."""


class ShownTopics:
    """Keeps one channel for each topic, and subscribes to the topics whose channels viewers subscribe to.

    One thread opens and closes channels and subscriptions, so that neither viewers nor messages wait for the master.

    Args:
        viewers: The server.
        time_ns: Returns the time of a message that has just come [ns].
    """

    def __init__(self, viewers: Viewers, time_ns: Callable[[], int]) -> None:
        self._viewers, self._time_ns = viewers, time_ns
        self._lock = threading.Lock()
        self._changed = threading.Event()
        self._names: dict[str, None] = {}
        """Topics that the thread has to look at, in order."""
        self._rows: dict[str, TopicRow] = {}
        self._definitions: dict[str, TypeDefinition] = {}
        """Definitions that publishers have sent, by topic, where no package has them or other ones."""
        self._asked_s: dict[str, float] = {}
        self._shown: dict[str, ShownTopic] = {}
        self._by_id: dict[int, ShownTopic] = {}
        self._warn = ThrottledWarning()
        self.table = TopicTable(self._on_change)
        rospy.on_shutdown(self._changed.set)
        threading.Thread(target=self._run, name="shown topics", daemon=True).start()

    def look(self) -> None:
        """Asks the master for topics, and again for the definitions that are missing."""
        self.table.look()
        with self._lock:
            missing = self._rows.keys() - self._shown.keys()
        for name in missing:
            self._look_at(name)

    def subscribe(self, viewer: int, channel: int) -> None:
        """Adds a viewer to a channel.

        Args:
            viewer: Number of the viewer.
            channel: Number of the channel.
        """
        with self._lock:
            shown = self._by_id.get(channel)
            if shown is None:
                return
            shown.viewers.add(viewer)
            shown.has_newcomer = True
        self._look_at(shown.name)

    def unsubscribe(self, viewer: int, channel: int) -> None:
        """Removes a viewer from a channel."""
        with self._lock:
            shown = self._by_id.get(channel)
            if shown is None:
                return
            shown.viewers.discard(viewer)
        self._look_at(shown.name)

    @property
    def has_viewers(self) -> bool:
        """Whether any topic is shown to a viewer."""
        with self._lock:
            return any(shown.viewers for shown in self._by_id.values())

    def _on_change(self, before: TopicRow | None, after: TopicRow | None) -> None:
        name = (before or after).name  # type: ignore[union-attr]
        with self._lock:
            if after is None:
                del self._rows[name]
                self._definitions.pop(name, None)
                self._asked_s.pop(name, None)
            else:
                self._rows[name] = after
        self._look_at(name)

    def _look_at(self, name: str) -> None:
        with self._lock:
            self._names[name] = None
        self._changed.set()

    def _run(self) -> None:
        while not rospy.is_shutdown():
            self._changed.wait()
            self._changed.clear()
            with self._lock:
                names, self._names = self._names, {}
            for name in names:
                try:
                    self._update(name)
                except rospy.ROSException:
                    return  # the node is shutting down
                except Exception as error:
                    self._warn(name, f"not shown: {error}")

    def _update(self, name: str) -> None:
        """Makes channel and subscription of a topic agree with the master's data and with the viewers."""
        with self._lock:
            row, shown, sent = self._rows.get(name), self._shown.get(name), self._definitions.get(name)
        definition = shown.definition if shown is not None else None
        if row is not None and (definition is None or sent is not None or definition.name != row.type):
            definition = _definition_of(row, sent)
            if definition is None:
                self._ask(row)
        if shown is not None and (row is None or definition != shown.definition):
            with self._lock:
                del self._shown[name], self._by_id[shown.channel.id()]
            shown.close()
            shown = None
        if shown is None and row is not None and definition is not None:
            channel = self._viewers.channel(name, definition.name, definition.text)
            shown = ShownTopic(name, definition, channel, self._time_ns, self._on_header)
            with self._lock:
                self._shown[name] = self._by_id[channel.id()] = shown
        if shown is not None:
            with self._lock:
                has_newcomer, shown.has_newcomer = shown.has_newcomer, False
            shown.follow(has_newcomer)

    def _ask(self, row: TopicRow) -> None:
        """Has the publishers of a topic asked for its definition, in a thread, since a publisher may hang."""
        now_s = time.monotonic()
        if now_s - self._asked_s.get(row.name, -ASK_AGAIN_S) < ASK_AGAIN_S:
            return
        self._asked_s[row.name] = now_s

        def ask() -> None:
            definition = ask_publishers(row.name, row.publishers)
            if definition is None:
                self._warn(row.name, f"not shown: its type {row.type} is not installed, and no publisher sent it")
                return
            with self._lock:
                self._definitions[row.name] = definition
            self._look_at(row.name)

        threading.Thread(target=ask, name="asking", daemon=True).start()

    def _on_header(self, shown: ShownTopic, header: Mapping[str, str]) -> None:
        """Notes whether a topic is latched. If a publisher has another definition, shows the topic with it."""
        self.table.learn(shown.name, header)
        definition = TypeDefinition.in_header(header)
        if definition is None or definition.md5sum == shown.definition.md5sum:
            return
        if shown.has_messages:
            self._warn(shown.name, f"messages of {header.get('callerid')} left out: they have another type")
            return
        with self._lock:
            self._definitions[shown.name] = definition
        self._look_at(shown.name)


def _definition_of(row: TopicRow, sent: TypeDefinition | None) -> TypeDefinition | None:
    """Returns the definition that a publisher has sent, or else that of the installed package; None without both."""
    if sent is not None and row.type in (sent.name, UNKNOWN_TYPE):
        return sent
    message_class = installed_message(row.type)
    return None if message_class is None else TypeDefinition.of(message_class)


class ShownTopic:
    """The channel of a topic, and the subscription, if a viewer wants it.

    Args:
        name: Name of the topic.
        definition: Its message type.
        channel: Where messages are sent to viewers.
        time_ns: Returns the time of a message that has just come [ns].
        on_header: Called with this object and the header of each new connection to a publisher.

    Attributes:
        viewers: Numbers of the viewers that want the messages.
        has_newcomer: Whether a viewer has not been sent the latched messages.
        has_messages: Whether a message has been passed on.
    """

    def __init__(
        self,
        name: str,
        definition: TypeDefinition,
        channel: Any,
        time_ns: Callable[[], int],
        on_header: Callable[[ShownTopic, Mapping[str, str]], None],
    ) -> None:
        self.name, self.definition, self.channel = name, definition, channel
        self.viewers: set[int] = set()
        self.has_newcomer = False
        self.has_messages = False
        self._time_ns, self._on_header = time_ns, on_header
        self._headers: dict[str, Mapping[str, str]] = {}
        self._latched: dict[str, bytes] = {}
        """Last message of each publisher that latches, by the publisher's name."""
        self._subscriber: rospy.Subscriber | None = None

    def follow(self, has_newcomer: bool) -> None:
        """Subscribes or unsubscribes, as the viewers want it.

        Args:
            has_newcomer: Whether latched messages are sent again, for a viewer that came after them. They go to all
                viewers, since foxglove-sdk does not say how to send to one.
        """
        if not self.viewers:
            self._unsubscribe()
        elif self._subscriber is None:
            self._subscriber = rospy.Subscriber(
                self.name, rospy.AnyMsg, self._on_message, tcp_nodelay=True, buff_size=1 << 20
            )
        elif has_newcomer:
            for message in list(self._latched.values()):
                self.channel.log(message, log_time=self._time_ns())

    def close(self) -> None:
        """Unsubscribes, and withdraws the channel."""
        self._unsubscribe()
        self.channel.close()

    def _unsubscribe(self) -> None:
        if self._subscriber is not None:
            self._subscriber.unregister()
            self._subscriber = None
            self._headers.clear()
            self._latched.clear()

    def _on_message(self, message: Any) -> None:
        header, data = message._connection_header, message._buff
        publisher = header.get("callerid", "")
        if self._headers.get(publisher) is not header:
            self._headers[publisher] = header
            self._on_header(self, header)
        if header.get("md5sum") != self.definition.md5sum:
            return
        if header.get("latching") == "1":
            self._latched[publisher] = data
        self.has_messages = True
        self.channel.log(data, log_time=self._time_ns())
