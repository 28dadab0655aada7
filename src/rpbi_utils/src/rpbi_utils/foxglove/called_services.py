"""Offers the services of a ROS system to viewers."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import rosgraph
import rospy
import rosservice

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning

from .type_messages import installed_service, read_message, write_message
from .viewer_server import RateLimit, Viewers

ASK_AGAIN_S = 10.0
"""Time until a service that did not say its type is asked again [s]."""
THREADS = 4
"""Number of services that are asked for their types at the same time."""
CALLS_HZ = 200.0
"""Largest rate of calls from one viewer [Hz]."""


class CallError(InterfaceError):
    """A viewer's call of a service failed. The viewer receives the message."""


class CalledServices:
    """Offers each service whose type is installed, and calls it for viewers.

    The ROS master does not know the types of services, so each service is asked once for its type.

    Args:
        viewers: The server.
    """

    def __init__(self, viewers: Viewers) -> None:
        self._viewers = viewers
        self._lock = threading.Lock()
        self._asked_s: dict[str, float] = {}
        """Time at which each service was asked for its type [s]."""
        self._offered: set[str] = set()
        self._limit = RateLimit(CALLS_HZ)
        self._warn = ThrottledWarning()
        self._threads = ThreadPoolExecutor(THREADS, "service types")
        rospy.on_shutdown(lambda: self._threads.shutdown(wait=False, cancel_futures=True))

    def update(self, providers: Mapping[str, object]) -> None:
        """Offers new services, and withdraws services that have disappeared.

        Args:
            providers: Names of the present services, as the keys.
        """
        now_s = time.monotonic()
        with self._lock:
            gone = self._offered - providers.keys()
            self._offered -= gone
            self._asked_s = {name: at_s for name, at_s in self._asked_s.items() if name in providers}
            due = [
                name
                for name in providers
                if name not in self._offered and now_s - self._asked_s.get(name, -ASK_AGAIN_S) >= ASK_AGAIN_S
            ]
            self._asked_s.update(dict.fromkeys(due, now_s))
        if gone:
            self._viewers.withdraw_services(gone)
        for name in due:
            self._threads.submit(self._offer, name)

    def _offer(self, name: str) -> None:
        try:
            type_name = rosservice.get_service_type(name)
        except (rosservice.ROSServiceException, rosgraph.MasterException, OSError):
            return
        if type_name is None:  # the service has disappeared
            return
        service_class = installed_service(type_name)
        if service_class is None:
            self._warn(name, f"service not offered: its type {type_name} is not installed")
            return

        def call(request: Any) -> bytes:
            return self._call(name, service_class, request.client_id, request.payload)

        parts = service_class._request_class, service_class._response_class
        request, response = ((each._type, each._full_text) for each in parts)
        with self._lock:
            self._offered.add(name)
        self._viewers.offer_service(name, type_name, request, response, call)

    def _call(self, name: str, service_class: Any, viewer: int, payload: bytes) -> bytes:
        if not self._limit.allows(viewer):
            raise CallError(f"more than {CALLS_HZ:g} calls in a second")
        try:
            request = read_message(service_class._request_class, payload)
        except ValueError:
            raise CallError(f"the request is no {service_class._type}Request") from None
        try:
            response = rospy.ServiceProxy(name, service_class)(request)
        except (rospy.ServiceException, rospy.ROSException, OSError) as error:
            raise CallError(str(error)) from None
        return write_message(response)
