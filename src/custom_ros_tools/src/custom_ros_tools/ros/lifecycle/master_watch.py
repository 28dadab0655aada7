"""Registers a node again when the ROS master has restarted and lost the node's registrations."""

import contextlib
import threading
from typing import Any
from xmlrpc.client import MultiCall

import rosgraph
import rospy

from custom_ros_tools.ros.rospy_internals import Registry, answer_cached, registry

from .node_logging import LOG_PARAMETER
from .parameters import kept_parameters
from .timed_master import MASTER_FAILURES, timed_master
from .wall_time import WallTimer

LOOK_HZ = 1.0
_METHODS = {"sub": "Subscriber", "pub": "Publisher", "srv": "Service"}


class Registrations:
    """Registers the topics and services of this node with the ROS master, in place of rospy's own code.

    rospy's own code blocks all topics while the master is unreachable, and does not register topics again with a
    restarted master. This class also registers changes that were made while the master was unreachable, as soon as the
    master is reachable.

    Args:
        registry: The node's topics and services.
        uri: Address of the master.

    Attributes:
        are_complete: Whether the master has all registrations. False from a failed call until `repeat` succeeds.
    """

    def __init__(self, registry: Registry, uri: str) -> None:
        self.are_complete = True
        self._registry, self._uri = registry, uri
        self._name, self._node_uri = rospy.get_name(), rospy.get_node_uri()
        self._withdrawn: list[tuple[str, tuple[str, str, str]]] = []
        """Method names and arguments of the calls that unregister, to be made when the master is reachable."""
        registry.hand_over(self)

    def reg_added(self, name: str, type_or_uri: str, kind: str) -> None:
        """Registers a topic or service with the master; called by rospy.

        Args:
            name: Name of the topic or service.
            type_or_uri: Type of the topic, or address of the service.
            kind: `sub`, `pub` or `srv`.
        """
        if not self.are_complete:
            return
        try:
            with timed_master(self._uri) as master:
                call = getattr(master, f"register{_METHODS[kind]}")
                answer = call(self._name, name, type_or_uri, self._node_uri)
        except MASTER_FAILURES:
            self.are_complete = False
            return
        self._on_answer(kind, name, answer)

    def reg_removed(self, name: str, type_or_uri: str, kind: str) -> None:
        """Unregisters a topic or service from the master; called by rospy. For the arguments see `reg_added`."""
        uri = type_or_uri if kind == "srv" else self._node_uri
        method, arguments = f"unregister{_METHODS[kind]}", (self._name, name, uri)
        try:
            if self.are_complete:
                with timed_master(self._uri) as master:
                    getattr(master, method)(*arguments)
                return
        except MASTER_FAILURES:
            self.are_complete = False
        self._withdrawn.append((method, arguments))

    def repeat(self, master: Any) -> tuple[int, int]:
        """Registers all topics and services again, and restores the kept parameters.

        Args:
            master: Interface of the master, see `timed_master`.

        Returns:
            Number of topics, and number of services.
        """
        with self._registry.entries() as entries:  # locks topics and services
            kept_parameters.restore(master)
            calls: Any = MultiCall(master)
            for method, arguments in self._withdrawn:
                getattr(calls, method)(*arguments)
            for kind, name, type_or_uri in entries:
                getattr(calls, f"register{_METHODS[kind]}")(self._name, name, type_or_uri, self._node_uri)
            answers = list(calls())[len(self._withdrawn) :]
            self._withdrawn.clear()
            self.are_complete = True
        for (kind, name, _), answer in zip(entries, answers, strict=True):
            self._on_answer(kind, name, answer)
        served = sum(kind == "srv" for kind, _, _ in entries)
        return len(entries) - served, served

    def connect_missing(self) -> None:
        """Reconnects subscriptions that have lost connections to publishers."""
        self._registry.subscriptions.connect_missing()

    def _on_answer(self, kind: str, name: str, answer: tuple[int, str, Any]) -> None:
        code, message, value = answer
        if code != 1:
            rospy.logfatal("the ROS master does not take %s: %s", name, message)
        elif kind == "sub":
            self._registry.subscriptions.on_report(name, value)


class MasterWatch:
    """Checks the ROS master once a second, until the node shuts down. Create one object, after `rospy.init_node`.

    If the master cannot be reached, a warning is logged; existing connections continue. When a restarted master is
    reachable, all topics, services and parameters of the node are registered again, which rospy itself does not do. If
    another node has registered the same name in the meantime, this node ends, as ROS requires for duplicate names. If
    rospy has unexpected internals, a warning at the start says that the node cannot register again.
    """

    def __init__(self) -> None:
        self._name, self._uri = rospy.get_name(), rosgraph.get_master_uri()
        found = registry()
        self._registrations = None if found is None else Registrations(found, self._uri)
        self._process: int | None = None
        self._is_gone = self._is_over = False
        self._registering = threading.Lock()
        with contextlib.suppress(*MASTER_FAILURES), timed_master(self._uri) as master:
            self._process = master.getPid(self._name)[2]
            kept_parameters.keep("/use_sim_time")
            kept_parameters.keep(self._name)
            # rospy reads this parameter for each logged line. A hanging master would block all threads that log.
            answer_cached(LOG_PARAMETER, rospy.get_param_cached(LOG_PARAMETER, False))
        rospy.on_shutdown(self._end)
        WallTimer(LOOK_HZ, self._look)

    def _look(self) -> None:
        if self._registrations is not None:
            self._registrations.connect_missing()
        try:
            with timed_master(self._uri) as master:
                self._compare(master)
        except MASTER_FAILURES as error:
            if not self._is_gone and not rospy.core.is_shutdown_requested():
                rospy.logwarn(
                    "the ROS master at %s cannot be reached (%s): %s keeps its existing connections",
                    self._uri,
                    error,
                    self._name,
                )
            self._is_gone = True
            if self._registrations is not None:
                self._registrations.are_complete = False

    def _compare(self, master: Any) -> None:
        """Compares the master's data about this node with the node's state, and registers again or ends the node."""
        calls: Any = MultiCall(master)
        calls.getPid(self._name)
        calls.lookupNode(self._name, self._name)
        (_, _, process), (_, _, node_uri) = calls()
        if node_uri and node_uri != rospy.get_node_uri():
            if not rospy.core.is_shutdown_requested():
                rospy.logfatal("another node has taken the name %s (at %s): this one ends", self._name, node_uri)
                rospy.signal_shutdown("another node has its name")
        elif self._registrations is None:
            if process != self._process:
                rospy.logwarn("the ROS master at %s was restarted: it does not know %s", self._uri, self._name)
            self._process, self._is_gone = process, False
        elif process != self._process or not node_uri or not self._registrations.are_complete:
            self._register(master, self._registrations)
            self._process, self._is_gone = process, False

    def _register(self, master: Any, registrations: Registrations) -> None:
        with self._registering:
            if self._is_over:
                return
            topics, services = registrations.repeat(master)
        rospy.loginfo(
            "the ROS master at %s is back: %s has registered its %d topics and %d services again",
            self._uri,
            self._name,
            topics,
            services,
        )

    def _end(self) -> None:
        """Prevents further registrations; called when the node shuts down."""
        with self._registering:
            self._is_over = True
