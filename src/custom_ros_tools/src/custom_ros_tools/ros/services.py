"""Services that switch a function on and off, and service proxies that wait for their service."""

import threading
from collections.abc import Callable, Mapping
from typing import Any

import rospy
from std_srvs.srv import SetBool, SetBoolRequest, SetBoolResponse

from custom_ros_tools.errors import InterfaceError

PATIENCE_S = 5.0
"""Time after which a wait for a service is reported with a warning [s]."""
Handler = Callable[[], tuple[bool, str]]


class Toggle:
    """Switches a function of a node on and off. Fails if the function is already in the requested state. Thread-safe.

    Args:
        name: Name of the function in messages.
        start: Called to switch the function on.
        stop: Called to switch the function off.
    """

    def __init__(self, name: str, start: Callable[[], None], stop: Callable[[], None]) -> None:
        self._name, self._start, self._stop = name, start, stop
        self._is_on = False
        self._lock = threading.Lock()

    def on(self) -> tuple[bool, str]:
        """Switches the function on; returns whether it was off before, and a message."""
        return self._switch(True, self._start, "on")

    def off(self) -> tuple[bool, str]:
        """Switches the function off; returns whether it was on before, and a message."""
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
    """Waits until a service is available, without a time limit, and returns a proxy for the service.

    Args:
        srv_name: Name of the service.
        srv_type: Type of the service.
        persistent: Whether to keep one connection open, which is faster, but fails if the server restarts.
        headers: Additional header fields of the connection.

    Raises:
        rospy.ROSInterruptException: If ROS shuts down during the wait.
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
    """Waits for several services, see `get_srv_handler`.

    Args:
        srvs: Types of the services, indexed by service name.
        persistent: Whether to keep the connections open.

    Returns:
        The proxies, indexed by service name.
    """
    return {name: get_srv_handler(name, srv_type, persistent) for name, srv_type in srvs.items()}


def call_service(name: str, srv_type: type, *arguments: object) -> Any:
    """Waits until a service is available, calls it once, and returns the response.

    Args:
        name: Name of the service.
        srv_type: Type of the service; the response must have the fields `success` and `message`.
        arguments: Fields of the request.

    Raises:
        InterfaceError: If `success` is false in the response.
    """
    answer = get_srv_handler(name, srv_type)(*arguments)
    if not answer.success:
        raise InterfaceError(f"{name}: {answer.message}")
    return answer


class ToggleService(rospy.Service):
    """A std_srvs/SetBool service that calls one function for true, and another function for false.

    Args:
        name: Name of the service.
        enable_handler: Function for true; returns the response's fields `success` and `message`.
        disable_handler: Function for false; returns the response's fields `success` and `message`.
        options: Options of `rospy.Service`, such as `error_handler`.
    """

    def __init__(self, name: str, enable_handler: Handler, disable_handler: Handler, **options: Any) -> None:
        self._enable, self._disable = enable_handler, disable_handler
        super().__init__(name, SetBool, self.toggle, **options)

    def toggle(self, req: SetBoolRequest) -> SetBoolResponse:
        """Handles a request to the service. Python code can also call this method directly."""
        success, message = self._enable() if req.data else self._disable()
        return SetBoolResponse(success, message)
