"""Connections of a node's topics: accepted, kept and closed."""

from __future__ import annotations

from contextlib import suppress
from functools import partial
from importlib import import_module
from typing import Any
from weakref import WeakMethod

import rospy

from custom_ros_tools.ros.server_socket import ServerSocket

from .expecting import expecting


def close_poller_with(topic: rospy.topics.Topic) -> None:
    """Closes the poller of a topic's connections, a file, with the topic.

    It references its own methods, so that rospy leaves it to Python's garbage collector, which may run late.
    """
    # Without these parts, nothing is lost but a file for a while.
    poller = getattr(getattr(topic, "impl", None), "connection_poll", None)
    for name, method in list(vars(poller).items()) if poller is not None else ():
        if getattr(method, "__self__", None) is poller:
            setattr(poller, name, partial(_call, WeakMethod(method)))


def _call(method: WeakMethod, *arguments: Any) -> Any:
    bound = method()
    assert bound is not None  # the poller under test is there
    return bound(*arguments)


def keep_accepting() -> None:
    """Makes this process, before it is a node, accept connections whatever other clients do; see `ServerSocket`."""

    def wrap() -> None:
        server = import_module("rospy.impl.tcpros_base").TCPServer
        listening = server._create_server_sock
        server._create_server_sock = lambda self: ServerSocket(listening(self))

    expecting(
        "rospy.impl.tcpros_base.TCPServer to make its socket",
        "who connects and sends no header, or a lack of file handles, keeps others from this node",
        wrap,
    )


def keep_new_connections() -> None:
    """Makes this process, before it is a node, remove from its topics only connections that have ended.

    rospy finds a connection by its file number too, which a new connection gets as soon as the earlier one is closed.
    The new one may then be removed instead: without being closed, so that its subscriber waits forever, or closed.
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
                with lock:  # what it finds in here is not closed before it has removed it
                    if self.c_lock is not None:  # else the topic was closed meanwhile
                        check(self)

        topic.check, topic._remove_connection = check_locked, _remove_connection

    expecting(
        "rospy.topics._TopicImpl to check and remove its connections",
        "a subscriber that connects while another one ends may receive nothing",
        wrap,
    )


def _remove_connection(topic: Any, connections: list[Any], ended: Any) -> None:
    """Closes a connection of a topic and removes it from a list, in which it may be the one behind a queue."""
    if not ended.done:  # else its file is closed, and the number may be that of another connection
        with suppress(OSError, TypeError, ValueError):  # it was not polled
            topic.connection_poll.remove_fd(ended.fileno())
        with suppress(Exception):  # as rospy does
            ended.close()
    connections[:] = [each for each in connections if _without_queue(each) is not _without_queue(ended)]


def _without_queue(connection: Any) -> Any:
    return vars(connection).get("_connection", connection)
