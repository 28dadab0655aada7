"""Services: one that switches on and off, and proxies that wait for theirs."""

from collections.abc import Callable, Mapping
from typing import Any

import rospy
from std_srvs.srv import SetBool, SetBoolRequest, SetBoolResponse

from custom_ros_tools.errors import InterfaceError

PATIENCE_S = 5.0
"""After how long of waiting it is said what is waited for [s]."""


def get_srv_handler(
    srv_name: str, srv_type: type, persistent: bool = False, headers: dict[str, str] | None = None
) -> rospy.ServiceProxy:
    """Waits until a service is there, for ever if need be, and returns what calls it.

    Args:
        persistent: Whether to keep one connection open, which is faster and ends with the server.
        headers: What else to tell the server when connecting.

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
    """Does the same for several services, whose types are given by name; returns what calls them, by name."""
    return {name: get_srv_handler(name, srv_type, persistent) for name, srv_type in srvs.items()}


def call_service(name: str, srv_type: type, *arguments: object) -> Any:
    """Calls a service when it is there, and returns its answer.

    Raises:
        InterfaceError: If it answers that it did not succeed.
    """
    answer = get_srv_handler(name, srv_type)(*arguments)
    if not answer.success:
        raise InterfaceError(f"{name}: {answer.message}")
    return answer


Handler = Callable[[], tuple[bool, str]]


class ToggleService(rospy.Service):
    """A std_srvs/SetBool service.

    Args:
        name: Its name.
        enable_handler: Called on true; it returns success and a message, which are the answer.
        disable_handler: The same on false.
        options: Those of `rospy.Service`, such as `error_handler`.
    """

    def __init__(self, name: str, enable_handler: Handler, disable_handler: Handler, **options: Any) -> None:
        self._enable, self._disable = enable_handler, disable_handler
        super().__init__(name, SetBool, self.toggle, **options)

    def toggle(self, req: SetBoolRequest) -> SetBoolResponse:
        """Answers a request, which may be one that did not come from ROS."""
        success, message = self._enable() if req.data else self._disable()
        return SetBoolResponse(success, message)
