"""A service that switches something on and off."""

from __future__ import annotations

from collections.abc import Callable

import rospy
from std_srvs.srv import SetBool, SetBoolRequest, SetBoolResponse

Handler = Callable[[], tuple[bool, str]]


class ToggleService:
    """A std_srvs/SetBool service: true switches on, false off.

    Args:
        name: Its name.
        on: Called for true; returns success and a message.
        off: Called for false; returns success and a message.
    """

    def __init__(self, name: str, on: Handler, off: Handler) -> None:
        self._on, self._off = on, off
        self._service = rospy.Service(name, SetBool, self._handle)

    def _handle(self, request: SetBoolRequest) -> SetBoolResponse:
        success, message = self._on() if request.data else self._off()
        return SetBoolResponse(success, message)
