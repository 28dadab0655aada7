"""What a node has at the ROS master: told once, and told again to a master that has forgotten it."""

from __future__ import annotations

from typing import Any
from xmlrpc.client import MultiCall

import rospy
from rospy.impl.registration import (
    Registration,
    RegistrationListener,
    RegManager,
    get_registration_listeners,
    get_service_manager,
    get_topic_manager,
)

from .kept_parameters import kept_parameters
from .timed_master import MASTER_FAILURES, timed_master

_REGISTER = {
    Registration.SUB: "registerSubscriber",
    Registration.PUB: "registerPublisher",
    Registration.SRV: "registerService",
}
_UNREGISTER = {
    Registration.SUB: "unregisterSubscriber",
    Registration.PUB: "unregisterPublisher",
    Registration.SRV: "unregisterService",
}


class Registrations(RegistrationListener):  # type: ignore[misc]
    """Registers the topics and services of this node, in the place of rospy's own part for that.

    That one waits for a master that has gone, with all topics locked, and registers nothing again. Here what is opened
    or closed while there is no master is told to the next one.

    Attributes:
        are_complete: Whether the master knows them all, as far as is known.
    """

    def __init__(self) -> None:
        self.are_complete = True
        self._name, self._node_uri = rospy.get_name(), rospy.get_node_uri()
        self._withdrawn: list[tuple[str, tuple[str, str, str]]] = []
        """Calls that a master who comes back, and has not forgotten anything, has to hear."""
        listeners = get_registration_listeners()
        with listeners.lock:
            self._rospys = [each for each in listeners.listeners if isinstance(each, RegManager)]
            listeners.listeners[:] = [self if each in self._rospys else each for each in listeners.listeners]

    def reg_added(self, resolved_name: str, data_type_or_uri: str, reg_type: str) -> None:
        """Registers a topic or service; rospy calls it."""
        if not self.are_complete:
            return
        try:
            with timed_master() as master:
                call = getattr(master, _REGISTER[reg_type])
                answer = call(self._name, resolved_name, data_type_or_uri, self._node_uri)
        except MASTER_FAILURES:
            self.are_complete = False
            return
        self._take(reg_type, resolved_name, answer)

    def reg_removed(self, resolved_name: str, data_type_or_uri: str, reg_type: str) -> None:
        """Withdraws a topic or service; rospy calls it."""
        uri = data_type_or_uri if reg_type == Registration.SRV else self._node_uri
        call = _UNREGISTER[reg_type], (self._name, resolved_name, uri)
        try:
            if self.are_complete:
                with timed_master() as master:
                    getattr(master, call[0])(*call[1])
                return
        except MASTER_FAILURES:
            self.are_complete = False
        self._withdrawn.append(call)

    def repeat(self, master: Any) -> tuple[int, int]:
        """Registers everything again, and parameters with it.

        Args:
            master: See `timed_master`.

        Returns:
            The number of topics and that of services.
        """
        topics, services = get_topic_manager(), get_service_manager()
        with topics.lock, services.lock:  # no topic or service comes or goes meanwhile, as when rospy registers
            kept_parameters.restore(master)
            listed = [
                *((Registration.SUB, *each) for each in topics.get_subscriptions()),
                *((Registration.PUB, *each) for each in topics.get_publications()),
                *((Registration.SRV, *each) for each in services.get_services()),
            ]
            calls = MultiCall(master)
            for method, arguments in self._withdrawn:
                getattr(calls, method)(*arguments)
            for reg_type, name, data_type_or_uri in listed:
                getattr(calls, _REGISTER[reg_type])(self._name, name, data_type_or_uri, self._node_uri)
            answers = list(calls())[len(self._withdrawn) :]
            self._withdrawn.clear()
            self.are_complete = True
        for (reg_type, name, _), answer in zip(listed, answers, strict=True):
            self._take(reg_type, name, answer)
        served = sum(reg_type == Registration.SRV for reg_type, _, _ in listed)
        return len(listed) - served, served

    def _take(self, reg_type: str, name: str, answer: tuple[int, str, Any]) -> None:
        code, message, value = answer
        if code != 1:
            rospy.logfatal("the ROS master does not take %s: %s", name, message)
        elif reg_type == Registration.SUB:
            for rospys in self._rospys:
                rospys.publisher_update(name, value)  # connects to those that it is not connected to
