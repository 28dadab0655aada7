"""Publishes the messages that viewers send, for example from a teleoperation panel."""

from __future__ import annotations

import threading
import time
from collections import OrderedDict
from dataclasses import dataclass, field
from typing import Any

import rosgraph.names
import rospy

from custom_ros_tools.errors import shortened
from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning

from .type_messages import installed_message, read_message
from .viewer_server import ENCODING, RateLimit

MAX_TOPICS = 100
"""Largest number of topics that viewers announce, all viewers together; the oldest one is closed for a new one."""
MAX_WAITING = 10
"""Largest number of messages of a topic that wait until the topic is open."""
CONNECT_S = 2.0
"""Longest time that a topic's first messages wait for a subscriber [s]."""
MESSAGES_HZ = 2000.0
"""Largest rate of messages from one viewer [Hz]."""
BYTES_HZ = 32e6
"""Largest data rate of one viewer [bytes/s]."""
QUEUE_SIZE = 100


@dataclass
class _Offer:
    """A topic that a viewer has announced to publish."""

    topic: str
    message_class: Any
    waiting: list[Any] = field(default_factory=list)


class SentTopics:
    """Opens a publisher for each topic that viewers announce, and publishes their messages.

    One thread opens and closes publishers, so that viewers do not wait for the master.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._changed = threading.Event()
        self._offers: OrderedDict[tuple[int, int], _Offer] = OrderedDict()
        self._publishers: dict[tuple[str, str], rospy.Publisher] = {}
        """Publishers by topic and type."""
        self._limit = RateLimit(MESSAGES_HZ, BYTES_HZ)
        self._warn = ThrottledWarning()
        rospy.on_shutdown(self._changed.set)
        threading.Thread(target=self._run, name="sent topics", daemon=True).start()

    def advertise(self, viewer: int, channel: Any) -> None:
        """Notes a topic that a viewer will publish.

        Args:
            viewer: Number of the viewer.
            channel: The announcement, a `foxglove.websocket.ClientChannel`.
        """
        message_class = installed_message(channel.schema_name)
        subject = f"viewer {viewer}, {shortened(channel.topic)}"
        if not rosgraph.names.is_legal_name(channel.topic) or not channel.topic.startswith("/"):
            self._warn(subject, "not published: this is no name of a ROS topic")
        elif channel.encoding != ENCODING:
            self._warn(subject, f"not published: expected encoding {ENCODING}, got {shortened(channel.encoding)}")
        elif message_class is None:
            self._warn(subject, f"not published: type {shortened(channel.schema_name)} is not installed")
        else:
            with self._lock:
                self._offers[viewer, channel.id] = _Offer(channel.topic, message_class)
                if len(self._offers) > MAX_TOPICS:
                    (other, _), oldest = self._offers.popitem(last=False)
                    self._warn(f"viewer {other}", f"{oldest.topic} closed: viewers have more than {MAX_TOPICS} topics")
            self._changed.set()

    def unadvertise(self, viewer: int, channel: int) -> None:
        """Closes a topic that a viewer has announced, unless another viewer publishes it too."""
        with self._lock:
            self._offers.pop((viewer, channel), None)
        self._changed.set()

    def send(self, viewer: int, channel: int, data: bytes) -> None:
        """Publishes a message of a viewer.

        Args:
            viewer: Number of the viewer.
            channel: Number of the viewer's channel.
            data: The serialised message.
        """
        if not self._limit.allows(viewer, len(data)):
            self._warn(
                f"viewer {viewer}",
                f"messages left out: more than {MESSAGES_HZ:g} in a second, or {BYTES_HZ / 1e6:g} MB",
            )
            return
        with self._lock:
            offer = self._offers.get((viewer, channel))
        if offer is None:
            return
        try:
            message = read_message(offer.message_class, data)
        except ValueError:
            self._warn(f"viewer {viewer}, {offer.topic}", f"message left out: it is no {offer.message_class._type}")
            return
        key = offer.topic, offer.message_class._type
        with self._lock:
            publisher = self._publishers.get(key)
            if publisher is None:
                offer.waiting = [*offer.waiting, message][-MAX_WAITING:]
                self._changed.set()
                return
        publisher.publish(message)

    def _run(self) -> None:
        while not rospy.is_shutdown():
            self._changed.wait()
            self._changed.clear()
            try:
                self._update()
            except rospy.ROSException as error:
                self._warn("publishing", str(error))

    def _update(self) -> None:
        """Opens the publishers that are missing, sends messages that wait, and closes publishers without an offer."""
        with self._lock:
            offers = list(self._offers.values())
            wanted = {(each.topic, each.message_class._type): each.message_class for each in offers}
            closed = [self._publishers.pop(key) for key in self._publishers.keys() - wanted.keys()]
            missing = wanted.keys() - self._publishers.keys()
        for publisher in closed:
            publisher.unregister()
        opened = {key: rospy.Publisher(key[0], wanted[key], queue_size=QUEUE_SIZE, tcp_nodelay=True) for key in missing}
        end_s = time.monotonic() + CONNECT_S
        for offer in offers:
            publisher = opened.get((offer.topic, offer.message_class._type))
            while publisher and offer.waiting and not publisher.get_num_connections() and time.monotonic() < end_s:
                time.sleep(0.01)
        with self._lock:
            self._publishers.update(opened)
            waiting = [(offer, offer.waiting) for offer in offers]
            for offer in offers:
                offer.waiting = []
        for offer, messages in waiting:
            for message in messages:
                self._publishers[offer.topic, offer.message_class._type].publish(message)
