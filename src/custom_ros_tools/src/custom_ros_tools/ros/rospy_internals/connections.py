"""Connections of a node's topics: accepted, kept and closed."""

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
    """Closes the poller of a topic's connections, a file, with the topic.

    It references its own methods, so only Python's garbage collector frees it, which may run late.
    """
    # Without these parts, a file only stays open for a while.
    poller = getattr(getattr(topic, "impl", None), "connection_poll", None)
    for name, method in list(vars(poller).items()) if poller is not None else ():
        if getattr(method, "__self__", None) is poller:
            setattr(poller, name, partial(_call, WeakMethod(method)))


def _call(method: WeakMethod, *arguments: Any) -> Any:
    bound = method()
    assert bound is not None  # the poller under test is there
    return bound(*arguments)


def keep_accepting() -> None:
    """Makes the node that this process becomes accept connections regardless of other clients; see `ServerSocket`."""

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
    """Makes the node that this process becomes remove only closed connections from its topics.

    rospy also finds a connection by its file number, which a new connection may get when an earlier one is closed. It
    may then remove the new one instead, and its subscriber waits forever or is disconnected.
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
                with lock:  # connections in here are not closed before they are removed
                    if self.c_lock is not None:  # else the topic was closed meanwhile
                        check(self)

        topic.check, topic._remove_connection = check_locked, _remove_connection

    expecting(
        "rospy.topics._TopicImpl to check and remove its connections",
        "a subscriber that connects while another one ends may receive nothing",
        wrap,
    )


def _remove_connection(topic: Any, connections: list[Any], ended: Any) -> None:
    """Closes a connection of a topic and removes it from a list, where a queue may wrap it."""
    if not ended.done:  # otherwise its file is closed, and the number may be that of another connection
        with suppress(OSError, TypeError, ValueError):  # it was not polled
            topic.connection_poll.remove_fd(ended.fileno())
        with suppress(Exception):  # as rospy does
            ended.close()
    connections[:] = [each for each in connections if _without_queue(each) is not _without_queue(ended)]


def _without_queue(connection: Any) -> Any:
    return vars(connection).get("_connection", connection)
