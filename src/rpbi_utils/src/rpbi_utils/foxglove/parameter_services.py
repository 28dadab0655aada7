"""Shows the parameters of the ROS master to viewers, and sets those that viewers change."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any
from xmlrpc.client import Binary

import rosgraph.names
import rospy

from custom_ros_tools.errors import shortened
from custom_ros_tools.ros.lifecycle.timed_master import MASTER_FAILURES, timed_master
from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning

from .viewer_server import RateLimit, parameter

REQUESTS_HZ = 20.0
"""Largest rate of requests from one viewer [Hz]; each may be answered with all parameters."""
MAX_SET = 100
"""Largest number of parameters in one request."""


class MasterParameters:
    """Reads and sets the parameters of the ROS master for viewers."""

    def __init__(self) -> None:
        self._limit = RateLimit(REQUESTS_HZ)
        self._warn = ThrottledWarning()

    def get(self, viewer: int, names: list[str]) -> list[Any]:
        """Returns parameters by name, or all parameters if the list is empty.

        Args:
            viewer: Number of the viewer that asks.
            names: Names of parameters.
        """
        if not self._limit.allows(viewer):
            self._warn(f"viewer {viewer}", f"parameters left out: more than {REQUESTS_HZ:g} requests in a second")
            return []
        values = read_parameters()
        return [parameter(name, values[name]) for name in (set(names) & values.keys() if names else values)]

    def set(self, viewer: int, parameters: list[Any]) -> list[Any]:
        """Sets parameters, and deletes those without a value. Returns the parameters with their new values.

        Args:
            viewer: Number of the viewer that asks.
            parameters: The parameters, at most `MAX_SET`.
        """
        if not self._limit.allows(viewer) or len(parameters) > MAX_SET:
            limit = f"more than {MAX_SET} in a request, or {REQUESTS_HZ:g} requests in a second"
            self._warn(f"viewer {viewer}", f"parameters not set: {limit}")
            return []
        caller = rospy.get_name()
        done = []
        for each in parameters:
            name, value = each.name, each.get_value()
            if not name.startswith("/") or not rosgraph.names.is_legal_name(name) or name == "/":
                self._warn(f"viewer {viewer}", f"{shortened(name)} is no name of a parameter")
                continue
            try:
                with timed_master() as master:
                    if value is None:
                        master.deleteParam(caller, name)
                    else:
                        master.setParam(caller, name, Binary(value) if isinstance(value, bytes) else value)
            except (*MASTER_FAILURES, OverflowError, TypeError, ValueError) as error:
                self._warn(f"viewer {viewer}", f"{name} not set: {error}")
                continue
            done.append(each)
        return done


def read_parameters() -> dict[str, Any]:
    """Returns the values of all parameters, indexed by full name; empty if the master is unreachable."""
    tree = read_parameter("/")
    return dict(_leaves("", tree)) if isinstance(tree, dict) else {}


def read_parameter(name: str) -> Any:
    """Returns the value of a parameter, or a namespace as a dictionary; None if there is none or no master."""
    try:
        with timed_master() as master:
            code, _, value = master.getParam(rospy.get_name(), name)
    except MASTER_FAILURES:
        return None
    return value if code == 1 else None


def _leaves(prefix: str, tree: dict[str, Any]) -> Iterator[tuple[str, Any]]:
    for key, value in tree.items():
        if isinstance(value, dict) and value:
            yield from _leaves(f"{prefix}/{key}", value)
        else:
            yield f"{prefix}/{key}", value.data if isinstance(value, Binary) else value
