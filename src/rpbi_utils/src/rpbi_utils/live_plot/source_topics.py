"""Feeds a plot with fields from topics. Topics may appear later, change their type, and disappear."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import rospy

from custom_ros_tools.errors import closest
from custom_ros_tools.ros.lifecycle.timed_master import MASTER_FAILURES, timed_master
from rpbi_data.bags.message_layout import MessageType

from .fields import FieldError, FieldReader, split_name
from .plot import LivePlot

LOOK_S = 1.0
"""Period of queries of the ROS master [s]."""
PATIENCE_S = 3.0
"""Time after the start from which missing topics are logged [s]. Nodes that start at the same time may need a while."""


class FieldSource:
    """Subscribes to topics as raw bytes, and reads fields with the message definitions that the publishers send.

    Args:
        names: Names such as `/arm/joint_states/position[0]`. Relative names are in this node's namespace.
        plot: Plot that receives the samples.
    """

    def __init__(self, names: Sequence[str], plot: LivePlot) -> None:
        self._plot = plot
        self._clock = _Clock()
        self._names = {name: name if name.startswith("/") else rospy.get_namespace() + name for name in names}
        self._ranks = {name: number for number, name in enumerate(names)}
        self._topics: dict[str, _Topic] = {}
        self._begin_s = time.monotonic()
        self._logged: set[str] = set()
        for name in names:
            plot.note(name, "waiting for the topic")
        threading.Thread(target=self._run, name="source", daemon=True).start()

    def _run(self) -> None:
        while not rospy.is_shutdown():
            try:
                self._look()
            except MASTER_FAILURES:
                pass  # subscriptions work without the ROS master
            except rospy.ROSException:  # the node is shutting down
                return
            time.sleep(LOOK_S)

    def _look(self) -> None:
        with timed_master() as master:
            _, _, (published, subscribed, _) = master.getSystemState(rospy.get_name())
        publishers = {topic for topic, _ in published}
        others = {topic for topic, nodes in subscribed if set(nodes) - {rospy.get_name()}}
        wanted: dict[str, list[tuple[str, str]]] = {}
        for name, resolved in self._names.items():
            found = split_name(resolved, publishers | others)
            if found is None:
                self._miss(name, resolved, publishers)
            else:
                wanted.setdefault(found[0], []).append((name, found[1]))
        for topic in self._topics.keys() - wanted.keys():
            if topic not in publishers | others:  # the topic has disappeared: keep its samples
                wanted[topic] = self._topics[topic].fields
        for topic in self._topics.keys() - wanted.keys():
            self._topics.pop(topic).close()
        for topic, fields in wanted.items():
            if topic in self._topics and self._topics[topic].fields != fields:
                self._topics.pop(topic).close()
            if topic not in self._topics:
                self._topics[topic] = _Topic(topic, fields, self._ranks, self._plot, self._clock)
            self._topics[topic].is_published(topic in publishers)

    def _miss(self, name: str, resolved: str, topics: Iterable[str]) -> None:
        alike = closest(resolved.rpartition("/")[0] or resolved, topics)
        question = f"; did you mean '{alike}'?" if alike else ""
        self._plot.note(name, f"no such topic yet{question}")
        if time.monotonic() - self._begin_s > PATIENCE_S and name not in self._logged:
            self._logged.add(name)
            rospy.logwarn("%s: no such topic yet%s", name, question)


class _Clock:
    """Assigns a time to each sample, which is the stamp of the sample's message.

    For a message without a stamp, the time is the newest stamp plus the time since this stamp arrived.
    """

    def __init__(self) -> None:
        self._stamp_s, self._at_s = 0.0, time.monotonic()

    def time_of(self, stamp_s: float | None) -> float:
        """Returns the time of a message that has just arrived [s]."""
        if stamp_s is None:
            return self._stamp_s + time.monotonic() - self._at_s
        self._stamp_s, self._at_s = stamp_s, time.monotonic()
        return stamp_s


class _Topic:
    """Subscribes to a topic and adds the values of its selected fields to the plot."""

    def __init__(
        self, topic: str, fields: list[tuple[str, str]], ranks: Mapping[str, int], plot: LivePlot, clock: _Clock
    ) -> None:
        self.fields = fields
        self._ranks = ranks
        self._topic, self._plot, self._clock = topic, plot, clock
        self._readers = [(name, FieldReader(topic, path)) for name, path in fields]
        self._types: dict[str, MessageType] = {}
        self._errors: dict[str, str] = {}
        self._drawn: set[str] = set()
        self._type: MessageType | None = None
        self._subscriber = rospy.Subscriber(topic, rospy.AnyMsg, self._on_message, tcp_nodelay=True)

    def close(self) -> None:
        """Unsubscribes."""
        self._subscriber.unregister()

    def is_published(self, is_published: bool) -> None:
        """Shows a text in the plot if the topic has no publisher or no message yet; otherwise removes the text."""
        for name, _ in self.fields:
            if not is_published:
                self._plot.note(name, "nobody publishes it")
            elif name not in self._errors:
                self._plot.note(name, "" if self._type else "no message yet")

    def _on_message(self, message: Any) -> None:
        try:
            message_type = self._type_of(message._connection_header)
        except ValueError as error:
            self._fail([name for name, _ in self.fields], f"{self._topic}: {error}")
            return
        if message_type is not self._type:
            self._type = message_type
            self._drawn.clear()
        time_s: float | None = None
        for name, reader in self._readers:
            try:
                values = reader.read(message_type, message._buff)
            except FieldError as error:
                self._fail([name], str(error))
                continue
            except ValueError as error:
                self._fail([name], f"{self._topic}: a message does not fit its type: {error}")
                continue
            if name in self._errors and values.by_name:
                del self._errors[name]
                self._plot.note(name, "")
            if time_s is None:
                time_s = self._clock.time_of(values.stamp_s)
            for field, value in values.by_name.items():
                self._plot.add(f"{self._topic}/{field}", time_s, value, self._ranks[name])
            if values.by_name:
                self._drawn.add(name)

    def _type_of(self, header: dict[str, str]) -> MessageType:
        key = header["md5sum"]
        if key not in self._types:
            self._types[key] = MessageType.parse(header["type"], header["message_definition"])
        return self._types[key]

    def _fail(self, names: Iterable[str], text: str) -> None:
        """Shows and logs an error once for each name.

        Skips names whose values have already been plotted, since single messages may lack a joint.
        """
        for name in names:
            if name not in self._drawn and self._errors.get(name) != text:
                self._errors[name] = text
                self._plot.note(name, text)
                rospy.logwarn("%s", text)
