"""A topic keeps the connection of a new subscriber, whatever becomes of one that had its file number before."""

from __future__ import annotations

import os
import socket
import threading
from collections.abc import Iterator
from itertools import count

import pytest
from rospy.impl.tcpros_base import TCPROSTransport, TCPROSTransportProtocol
from rospy.topics import _PublisherImpl, _TopicImpl
from std_msgs.msg import Empty

from custom_ros_tools.ros.rospy_internals import keep_new_connections

MENDED = pytest.mark.parametrize("is_mended", [True, False], ids=["mended", "rospy by itself"])
NAME = "/topic"


class Topic:
    """A topic of rospy whose subscribers are the other ends of sockets."""

    def __init__(self, queue_size: int | None) -> None:
        self.impl = _PublisherImpl(NAME, Empty)
        self.impl.set_queue_size(queue_size)
        self.ends: list[socket.socket] = []
        self._connections: list[TCPROSTransport] = []

    def connect(self, subscriber: str, file: int | None = None) -> TCPROSTransport:
        """Connects a subscriber by name; its connection replaces an open file, if one is given."""
        ours, theirs = socket.socketpair()
        if file is not None:
            with ours:
                ours = socket.socket(fileno=os.dup2(ours.fileno(), file))
        self.ends.append(theirs)
        connection = TCPROSTransport(TCPROSTransportProtocol(NAME, None), NAME)
        connection.set_socket(ours, subscriber)
        self._connections.append(connection)
        self.impl.add_connection(connection)
        return connection

    def close(self) -> None:
        """Ends the topic, and connections that it has lost: threads of their queues would wait forever."""
        for each in (*self._connections, *self.ends):
            each.close()
        self.impl.close()

    def reaches(self, subscriber: socket.socket) -> bool:
        """Returns whether a subscriber gets a message soon."""
        self.impl.publish(Empty())
        subscriber.settimeout(0.5)
        try:
            return bool(subscriber.recv(1))
        except TimeoutError:
            return False


@pytest.fixture(params=[None, 1], ids=["at once", "by a queue"])
def topic(request, monkeypatch, is_mended) -> Iterator[Topic]:
    for name in ("check", "_remove_connection"):
        monkeypatch.setattr(_TopicImpl, name, getattr(_TopicImpl, name))
    if is_mended:
        keep_new_connections()
    made = Topic(request.param)
    yield made
    made.close()


@MENDED
def test_who_comes_back_while_its_last_connection_ends_is_served(topic, is_mended):
    ended = topic.connect("/viewer")
    ended.socket.detach()
    topic.connect("/viewer", ended.fileno())  # before the thread that has closed the other one has removed it
    topic.impl.remove_connection(ended)
    assert topic.reaches(topic.ends[-1]) == is_mended


@pytest.mark.parametrize(
    ("is_mended", "call"),
    [(True, 1), (True, 2), (False, 1)],
    ids=["mended", "mended, under the lock", "rospy by itself"],
)
def test_connection_made_during_search_for_a_lost_one_is_served(topic, is_mended, call, monkeypatch):
    """The new connection gets the file of the lost one right after a call that has found that to be lost."""
    lost = topic.connect("/viewer")
    topic.ends[0].close()
    find = topic.impl.connection_poll.error_iter
    is_replaced, calls = threading.Event(), count(1)

    def replace() -> None:
        lost.socket.detach()
        topic.connect("/other", lost.fileno())
        lost.close()
        is_replaced.set()

    def find_late() -> list[int]:
        found = list(find())
        if next(calls) == call:
            threading.Thread(target=replace).start()
            is_replaced.wait(0.5)
        return found

    monkeypatch.setattr(topic.impl.connection_poll, "error_iter", find_late)
    topic.impl.check()
    assert is_replaced.wait(60.0)
    assert topic.reaches(topic.ends[-1]) == is_mended


@pytest.mark.parametrize("is_mended", [True])
def test_connections_that_end_are_removed(topic, is_mended):
    first, second, third = (topic.connect(name) for name in ("/a", "/b", "/c"))
    second.close()
    assert [each.endpoint_id for each in topic.impl.connections] == ["/a", "/c"]
    topic.ends[0].close()
    topic.impl.check()
    assert first.done and [each.endpoint_id for each in topic.impl.connections] == ["/c"]
    again = topic.connect("/c")
    assert third.done and not again.done and topic.impl.get_num_connections() == 1
    assert topic.reaches(topic.ends[-1])
