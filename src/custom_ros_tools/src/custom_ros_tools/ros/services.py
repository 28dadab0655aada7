"""Services: a function that is switched on and off, and proxies that wait for their service."""

import threading
from collections.abc import Callable, Mapping
from typing import Any

import rospy
from std_srvs.srv import SetBool, SetBoolRequest, SetBoolResponse

from custom_ros_tools.errors import InterfaceError

PATIENCE_S = 5.0
"""Time of waiting after which it is reported [s]."""
Handler = Callable[[], tuple[bool, str]]


class Toggle:
    """Stores whether a function is on; refuses to switch it to its present state.

    `start` switches it on and `stop` off; `name` is its name in messages.
    """

    def __init__(self, name: str, start: Callable[[], None], stop: Callable[[], None]) -> None:
        self._name, self._start, self._stop = name, start, stop
        self._is_on = False
        self._lock = threading.Lock()

    def on(self) -> tuple[bool, str]:
        """Switches it on; returns whether that changed anything, and a message."""
        return self._switch(True, self._start, "on")

    def off(self) -> tuple[bool, str]:
        """Switches it off; returns whether that changed anything, and a message."""
        return self._switch(False, self._stop, "off")

    def _switch(self, to: bool, act: Callable[[], None], word: str) -> tuple[bool, str]:
        with self._lock:
            if self._is_on == to:
                return False, f"{self._name} is already {word}"
            act()
            self._is_on = to
        return True, f"{self._name} is {word}"


def get_srv_handler(
    srv_name: str, srv_type: type, persistent: bool = False, headers: dict[str, str] | None = None
) -> rospy.ServiceProxy:
    """Waits until a service is available, without a time limit, and returns its proxy.

    Args:
        persistent: Whether to keep one connection open, which is faster and ends with the server.
        headers: Further headers of the connection.

    Raises:
        rospy.ROSInterruptException: If ROS shuts down meanwhile.
    """
    try:
        rospy.wait_for_service(srv_name, timeout=PATIENCE_S)
    except rospy.ROSInterruptException:
        raise
    except rospy.ROSException:
        rospy.logwarn("still waiting for service %s", rospy.resolve_name(srv_name))
        rospy.wait_for_service(srv_name)
    return rospy.ServiceProxy(srv_name, srv_type, persistent=persistent, headers=headers)


def get_srv_handlers(srvs: Mapping[str, type], persistent: bool = False) -> dict[str, rospy.ServiceProxy]:
    """Does the same for several services; `srvs` has their types by name; returns the proxies by name."""
    return {name: get_srv_handler(name, srv_type, persistent) for name, srv_type in srvs.items()}


def call_service(name: str, srv_type: type, *arguments: object) -> Any:
    """Calls a service once it is available, and returns its answer.

    Raises:
        InterfaceError: If the answer reports a failure.
    """
    answer = get_srv_handler(name, srv_type)(*arguments)
    if not answer.success:
        raise InterfaceError(f"{name}: {answer.message}")
    return answer


class ToggleService(rospy.Service):
    """A std_srvs/SetBool service.

    Args:
        name: Its name.
        enable_handler: Called on true; returns success and a message, which are the answer.
        disable_handler: The same on false.
        options: Options of `rospy.Service`, such as `error_handler`.
    """

    def __init__(self, name: str, enable_handler: Handler, disable_handler: Handler, **options: Any) -> None:
        self._enable, self._disable = enable_handler, disable_handler
        super().__init__(name, SetBool, self.toggle, **options)

    def toggle(self, req: SetBoolRequest) -> SetBoolResponse:
        """Answers a request, which may come from Python code, too."""
        success, message = self._enable() if req.data else self._disable()
        return SetBoolResponse(success, message)
