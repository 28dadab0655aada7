"""Publishers: sending to many subscribers without waiting, and longer queues for recorders."""

from __future__ import annotations

import socket
from contextlib import closing
from importlib import import_module
from typing import Any

import rospy

from custom_ros_tools.sockets import BufferedSocket, flush_buffered_sockets

from .expecting import expecting


class DirectSending:
    """Makes a publisher send in the publishing thread, through sockets that buffer until `flush_buffered_sockets`.

    With a queue size, rospy hands every message to a thread for each subscriber. At 1 kHz with a few subscribers, the
    contention of these threads for Python's lock costs more than the simulation. Without a queue size, one subscriber
    that does not read blocks everybody.
    """

    _is_possible: bool | None = None

    def __init__(self, publisher: rospy.Publisher, limit: int) -> None:
        self._topic, self._limit = publisher.impl, limit
        self._connections: Any = None
        self._topic.set_queue_size(None)

    @classmethod
    def of(cls, publisher: rospy.Publisher, limit: int) -> DirectSending | None:
        """Returns this sender for a publisher, None if rospy's internals differ; then the publisher stays unchanged.

        At most `limit` messages are buffered for each slow subscriber.
        """
        if cls._is_possible is None:
            cls._is_possible = bool(
                expecting(
                    "Publisher.impl to send by the sockets of its connections",
                    "messages are sent by rospy's queues and threads, which is slower at high rates",
                    lambda: cls._try(publisher),
                )
            )
        return cls(publisher, limit) if cls._is_possible else None

    def wrap_connections(self) -> None:
        """Replaces the sockets of new connections, so that sending never waits; called before each message."""
        connections = self._topic.connections  # rospy makes a new list whenever a connection is opened or closed
        if connections is not self._connections:
            for connection in connections:
                if isinstance(connection.socket, socket.socket):
                    connection.socket = BufferedSocket(connection.socket, self._limit)
            self._connections = connections

    @classmethod
    def _try(cls, publisher: rospy.Publisher) -> bool:
        """Tests the replacement on a private topic.

        Raises:
            Exception: If it is not possible.
        """
        tcpros = import_module("rospy.impl.tcpros_base")
        ours, theirs = socket.socketpair()
        with closing(ours), closing(theirs):
            trial = rospy.Publisher.__new__(rospy.Publisher)
            trial.impl = type(publisher.impl)("trial", publisher.data_class)
            sending = cls(trial, 1)
            before = trial.impl.connections
            connection = tcpros.TCPROSTransport(tcpros.TCPROSTransportProtocol("trial", None), "trial")
            connection.set_socket(ours, "trial")
            trial.impl.add_connection(connection)
            if trial.impl.connections is before:
                raise TypeError("the list of connections is the same as before the first one")
            sending.wrap_connections()
            trial.impl.publish(publisher.data_class())
            flush_buffered_sockets()
            theirs.setblocking(False)
            if not isinstance(connection.socket, BufferedSocket) or not theirs.recv(1):
                raise TypeError("nothing was sent by the socket of the connection")
            trial.impl.close()
        return True


class RecorderQueues:
    """Keeps more messages for recorders, which need all messages; a viewer needs the newest one.

    A recorder is a node whose name begins with `record`, such as `rosbag record`.

    Args:
        publisher: A publisher with a queue size, which stays unchanged for other subscribers.
        limit: Number of messages that are kept for a recorder; beyond it, the oldest are dropped.
    """

    def __init__(self, publisher: rospy.Publisher, limit: int) -> None:
        self._topic, self._limit = publisher.impl, limit
        self._connections: Any = None

    def extend(self) -> None:
        """Extends the queues of new recorders; called before each message."""
        connections = self._topic.connections  # rospy makes a new list whenever a connection is opened or closed
        if connections is not self._connections:
            self._connections = connections
            expecting(
                "the connections of a publisher to have a queue and an endpoint",
                "a recorder that gets no processor time loses large messages",
                lambda: self._extend(connections),
            )

    def _extend(self, connections: list[Any]) -> None:
        for each in connections:
            if each.endpoint_id.rpartition("/")[2].startswith("record"):
                each._queue_size = max(each._queue_size, self._limit)
