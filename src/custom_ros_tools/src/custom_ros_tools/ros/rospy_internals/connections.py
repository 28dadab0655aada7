"""Changes how rospy accepts, keeps and closes the connections of a node's topics."""

from __future__ import annotations

from contextlib import suppress
from functools import partial
from importlib import import_module
from typing import Any
from weakref import WeakMethod

import rospy

from custom_ros_tools.sockets import ServerSocket

from .expecting import expecting


def close_poller_with(topic: rospy.topics.Topic) -> None:
    """Makes rospy free the poller of a topic's connections, and its file handle, as soon as the topic is closed.

    The poller references its own methods. Without this change, it would stay until Python's garbage collector runs.
    """
    # If rospy lacks these parts, the file only stays open longer.
    poller = getattr(getattr(topic, "impl", None), "connection_poll", None)
    for name, method in list(vars(poller).items()) if poller is not None else ():
        if getattr(method, "__self__", None) is poller:
            setattr(poller, name, partial(_call, WeakMethod(method)))


def _call(method: WeakMethod, *arguments: Any) -> Any:
    bound = method()
    assert bound is not None  # the caller has a reference to the poller
    return bound(*arguments)


def keep_accepting() -> None:
    """Makes rospy use a `ServerSocket`, so that a slow client does not block other clients.

    Call this function before `rospy.init_node`.
    """

    def wrap() -> None:
        server = import_module("rospy.impl.tcpros_base").TCPServer
        listening = server._create_server_sock
        server._create_server_sock = lambda self: ServerSocket(listening(self))

    expecting(
        "rospy.impl.tcpros_base.TCPServer to make its socket",
        "a client that connects and sends no header, or a lack of file handles, blocks all other clients",
        wrap,
    )


def keep_new_connections() -> None:
    """Makes rospy remove only closed connections from topics. Call this function before `rospy.init_node`.

    rospy identifies a connection by its file number. After a connection is closed, a new connection may get the same
    number. If rospy then removes the new connection, the subscriber waits forever or is disconnected.
    """

    def wrap() -> None:
        topic = import_module("rospy.topics")._TopicImpl
        check, _ = topic.check, topic._remove_connection
        trial = topic("/trial", rospy.AnyMsg)
        with trial.c_lock:
            assert not [*trial.connection_poll.error_iter()]
        trial.close()

        def check_locked(self: Any) -> None:
            lock = self.c_lock
            if lock is not None and [*self.connection_poll.error_iter()]:
                with lock:  # while locked, connections are removed before they are closed
                    if self.c_lock is not None:  # None if the topic was closed in the meantime
                        check(self)

        topic.check, topic._remove_connection = check_locked, _remove_connection

    expecting(
        "rospy.topics._TopicImpl to check and remove its connections",
        "a subscriber that connects while another one ends may receive nothing",
        wrap,
    )


def _remove_connection(topic: Any, connections: list[Any], ended: Any) -> None:
    """Closes the connection `ended` of a topic, and removes it from a list.

    The list contains either the connection itself, or a queue that wraps the connection.
    """
    if not ended.done:  # otherwise the file is closed, and another connection may have the same number
        with suppress(OSError, TypeError, ValueError):  # the connection was not polled
            topic.connection_poll.remove_fd(ended.fileno())
        with suppress(Exception):  # as rospy does
            ended.close()
    connections[:] = [each for each in connections if _without_queue(each) is not _without_queue(ended)]


def _without_queue(connection: Any) -> Any:
    return vars(connection).get("_connection", connection)
