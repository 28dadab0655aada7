"""What a node has at the ROS master: registered once, and again at a master that has forgotten it."""

from __future__ import annotations

from typing import Any
from xmlrpc.client import MultiCall

import rospy

from custom_ros_tools.ros.rospy_internals import Registry

from .kept_parameters import kept_parameters
from .timed_master import MASTER_FAILURES, timed_master

_METHODS = {"sub": "Subscriber", "pub": "Publisher", "srv": "Service"}


class Registrations:
    """Registers the topics and services of this node, in the place of rospy's own part for that.

    That one waits for a master that has gone, with all topics locked, and registers nothing again. Here what is opened
    or closed while there is no master is told to the next one.

    Args:
        registry: The topics and services.

    Attributes:
        are_complete: Whether the master knows them all, as far as is known.
    """

    def __init__(self, registry: Registry) -> None:
        self.are_complete = True
        self._registry = registry
        self._name, self._node_uri = rospy.get_name(), rospy.get_node_uri()
        self._withdrawn: list[tuple[str, tuple[str, str, str]]] = []
        """Calls that a master who comes back, and has not forgotten anything, has to hear."""
        registry.hand_over(self)

    def reg_added(self, name: str, type_or_uri: str, kind: str) -> None:
        """Registers a topic or service; rospy calls it."""
        if not self.are_complete:
            return
        try:
            with timed_master() as master:
                call = getattr(master, f"register{_METHODS[kind]}")
                answer = call(self._name, name, type_or_uri, self._node_uri)
        except MASTER_FAILURES:
            self.are_complete = False
            return
        self._take(kind, name, answer)

    def reg_removed(self, name: str, type_or_uri: str, kind: str) -> None:
        """Withdraws a topic or service; rospy calls it."""
        uri = type_or_uri if kind == "srv" else self._node_uri
        method, arguments = f"unregister{_METHODS[kind]}", (self._name, name, uri)
        try:
            if self.are_complete:
                with timed_master() as master:
                    getattr(master, method)(*arguments)
                return
        except MASTER_FAILURES:
            self.are_complete = False
        self._withdrawn.append((method, arguments))

    def repeat(self, master: Any) -> tuple[int, int]:
        """Registers everything again, and parameters with it.

        Args:
            master: See `timed_master`.

        Returns:
            The number of topics and that of services.
        """
        with self._registry.entries() as entries:  # no topic or service comes or goes meanwhile
            kept_parameters.restore(master)
            calls = MultiCall(master)
            for method, arguments in self._withdrawn:
                getattr(calls, method)(*arguments)
            for kind, name, type_or_uri in entries:
                getattr(calls, f"register{_METHODS[kind]}")(self._name, name, type_or_uri, self._node_uri)
            answers = list(calls())[len(self._withdrawn) :]
            self._withdrawn.clear()
            self.are_complete = True
        for (kind, name, _), answer in zip(entries, answers, strict=True):
            self._take(kind, name, answer)
        served = sum(kind == "srv" for kind, _, _ in entries)
        return len(entries) - served, served

    def _take(self, kind: str, name: str, answer: tuple[int, str, Any]) -> None:
        code, message, value = answer
        if code != 1:
            rospy.logfatal("the ROS master does not take %s: %s", name, message)
        elif kind == "sub":
            self._registry.connect(name, value)
