"""Makes publishers send to many subscribers without waiting, and use longer queues for recorders."""

from __future__ import annotations

import socket
from contextlib import closing
from importlib import import_module
from typing import Any

import rospy

from custom_ros_tools.sockets import BufferedSocket, flush_buffered_sockets

from .expecting import expecting


class DirectSending:
    """Makes a publisher send in the publishing thread, through `BufferedSocket`s.

    rospy itself passes every message to a separate thread for each subscriber if a queue size is set. At 1 kHz with a
    few subscribers, these threads compete for Python's global lock, which costs more time than the simulation. Without
    a queue size, rospy sends in the publishing thread, but a subscriber that does not read blocks the publisher.

    Args:
        publisher: The publisher.
        limit: Largest number of messages that are buffered for each subscriber.
    """

    _is_possible: bool | None = None

    def __init__(self, publisher: rospy.Publisher, limit: int) -> None:
        self._topic, self._limit = publisher.impl, limit
        self._connections: Any = None
        self._topic.set_queue_size(None)

    @classmethod
    def of(cls, publisher: rospy.Publisher, limit: int) -> DirectSending | None:
        """Makes the sender for a publisher. If rospy has unexpected internals, returns None without any change.

        Args:
            publisher: The publisher.
            limit: Largest number of messages that are buffered for each subscriber.
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
        """Replaces the sockets of connections that opened since the last call by `BufferedSocket`s.

        Call before publishing each message.
        """
        connections = self._topic.connections  # rospy makes a new list whenever a connection is opened or closed
        if connections is not self._connections:
            for connection in connections:
                if isinstance(connection.socket, socket.socket):
                    connection.socket = BufferedSocket(connection.socket, self._limit)
            self._connections = connections

    @classmethod
    def _try(cls, publisher: rospy.Publisher) -> bool:
        """Tests the replacement of a socket on a topic that is not registered at the ROS master.

        Raises:
            Exception: If the replacement does not work.
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
    """Makes the queues of a publisher longer for recorders, since recorders need all messages.

    A recorder is a node whose name begins with `record`, such as `rosbag record`.

    Args:
        publisher: A publisher with a queue size. For other subscribers, the queue size does not change.
        limit: Queue size for recorders. If more messages wait, the oldest messages are dropped.
    """

    def __init__(self, publisher: rospy.Publisher, limit: int) -> None:
        self._topic, self._limit = publisher.impl, limit
        self._connections: Any = None

    def extend(self) -> None:
        """Enlarges the queues of recorders that connected since the last call. Call before publishing each message."""
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
