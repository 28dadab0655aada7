"""All private parts of rospy that this workspace uses.

rospy offers no way to send to many subscribers from one thread without waiting, nor to register again with a restarted
ROS master, and it mistakes connections for each other. Each use is tested when a node starts. If rospy has different
internals, one warning reports what was expected, what was found and what is lost, and the node continues without it.
"""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from functools import partial
from importlib import import_module
from itertools import count
from typing import Any, TypeVar
from weakref import WeakMethod

import rospy

from .buffered_socket import BufferedSocket, flush_buffered_sockets
from .server_socket import ServerSocket

T = TypeVar("T")


def _expecting(expected: str, loss: str, use: Callable[[], T]) -> T | None:
    """Returns the result of using private parts; None and a warning if they are not as expected.

    While rospy shuts down, its parts are in another state, which is no evidence of different internals.
    """
    try:
        return use()
    except Exception as error:  # whatever a different rospy raises, the node continues
        if not rospy.core.is_shutdown_requested():
            rospy.logwarn(
                "this rospy is built otherwise: expected %s, got %s: %s; %s",
                expected,
                type(error).__name__,
                error,
                loss,
            )
        return None


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
                _expecting(
                    "Publisher.impl to send by the sockets of its connections",
                    "messages go by rospy's queues and threads, which is slower at high rates",
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
    """Keeps more messages for subscribers that are recorders: these want all, and a viewer the newest.

    A recorder is a node whose name begins with `record`, as that of `rosbag record` does.

    Args:
        publisher: A publisher with a queue size, which stays as it is for others.
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
            _expecting(
                "the connections of a publisher to have a queue and an endpoint",
                "a recorder that gets no processor time loses large messages",
                lambda: self._extend(connections),
            )

    def _extend(self, connections: list[Any]) -> None:
        for each in connections:
            if each.endpoint_id.rpartition("/")[2].startswith("record"):
                each._queue_size = max(each._queue_size, self._limit)


class Subscriptions:
    """Connects the subscriptions of this node to all publishers that the ROS master has reported.

    rospy handles only the last report of each topic, although reports overtake each other. It also counts connections
    that have ended, so that it overlooks a publisher that comes back, or that has lost one connection.

    Args:
        manager: The part of rospy that receives the reports; they come here instead.
        topics: The topics of this node.
    """

    def __init__(self, manager: Any, topics: Any) -> None:
        self._topics, self._connect_topic = topics, manager.handler._connect_topic
        self._lock = threading.Lock()
        self._reports = count()
        self._reported: dict[tuple[str, str], int] = {}
        """Number of the last report of each topic and publisher."""
        self._connecting: set[tuple[str, str]] = set()
        if not callable(manager.publisher_update):
            raise TypeError("RegManager.publisher_update is no method")
        manager.publisher_update = self.on_report

    def on_report(self, topic: str, publishers: list[str]) -> None:
        """Connects a subscription to publishers, given by their URIs; existing connections stay."""
        with self._lock:
            self._reported.update({(topic, uri): next(self._reports) for uri in publishers})
        self.connect_missing()

    def connect_missing(self) -> None:
        """Connects to all reported publishers without a connection, without waiting for them."""
        with self._lock:
            missing = [pair for pair in self._reported if pair not in self._connecting and not self._has(*pair)]
            self._connecting.update(missing)
        for pair in missing:
            threading.Thread(target=self._connect, args=pair, daemon=True).start()

    def _has(self, topic: str, uri: str) -> bool:
        subscription = self._topics.get_subscriber_impl(topic)
        if subscription is None:
            return False
        for connection in getattr(subscription, "connections", ()):  # without this list, ended ones stay
            if connection.done:
                subscription.remove_connection(connection)
        return bool(subscription.has_connection(uri))

    def _connect(self, topic: str, uri: str) -> None:
        """Connects to one publisher; one that refuses is forgotten until it is reported again."""
        pair, code = (topic, uri), 0
        report = self._reported.get(pair)
        try:
            code, *_ = self._connect_topic(topic, uri)
        except Exception:
            if not rospy.core.is_shutdown_requested():  # else its parts are gone
                raise
        finally:
            with self._lock:
                self._connecting.discard(pair)
                if code != 1 and self._reported.get(pair) == report:
                    self._reported.pop(pair, None)


class Registry:
    """The topics and services of this node, from rospy.

    Attributes:
        subscriptions: Connects the node to the publishers of what it subscribes to.
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
            pass  # otherwise it would fail when it is needed
        self.subscriptions = Subscriptions(self._rospys, self._topics)
        rospy.core.add_shutdown_hook(lambda _: self._wake())  # rospy waits for its thread, up to 0.5 s

    @contextmanager
    def entries(self) -> Iterator[list[tuple[str, str, str]]]:
        """Yields the kind (`sub`, `pub`, `srv`), name and type or URI of all; none comes or goes in the context."""
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
        """Redirects registrations to another listener, instead of rospy, with `reg_added` and `reg_removed`."""
        with self._listeners.lock:
            self._listeners.listeners[self._listeners.listeners.index(self._rospys)] = listener


def registry() -> Registry | None:
    """Returns the registry of this node, None if rospy's internals differ."""
    return _expecting(
        "rospy.impl.registration to have RegManager among its listeners",
        "a ROS master that comes back will not know this node: start it again then",
        Registry,
    )


def close_poller_with(topic: rospy.topics.Topic) -> None:
    """Closes the poller of a topic's connections, a file, with the topic.

    It references its own methods, so that rospy leaves it to Python's garbage collector, which may run late.
    """
    poller = getattr(
        getattr(topic, "impl", None), "connection_poll", None
    )  # otherwise nothing is lost but a file for a while
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

    _expecting(
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

    _expecting(
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


def answer_cached(parameter: str, value: Any) -> None:
    """Makes `rospy.get_param_cached` answer without contacting the master."""
    _expecting(
        "rospy.impl.paramserver to have a cache",
        "who logs something waits for a master that hangs",
        lambda: import_module("rospy.impl.paramserver").get_param_server_cache().set(parameter, value),
    )
