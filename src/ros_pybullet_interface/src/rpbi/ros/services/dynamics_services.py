"""The services that tell and change how objects and links behave in contact and motion."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import rospy

from custom_ros_tools.config import load_configs
from custom_ros_tools.errors import InterfaceError
from ros_pybullet_interface.msg import ObjectDynamics
from ros_pybullet_interface.srv import ChangeDynamics as ChangeDynamicsService
from ros_pybullet_interface.srv import (
    ChangeDynamicsRequest,
    ChangeDynamicsResponse,
    ChangeObjectDynamics,
    ChangeObjectDynamicsRequest,
    ChangeObjectDynamicsResponse,
    GetObjectDynamics,
    GetObjectDynamicsRequest,
    GetObjectDynamicsResponse,
)
from rpbi.bodies.dynamics import LinkDynamics, difference
from rpbi.config.pybullet_models import ChangeDynamics
from rpbi.ros.requests import Requests
from rpbi.world import World

from .node_services import NodeService

DYNAMICS_SERVICES: dict[str, NodeService] = {
    "rpbi/get_pybullet_object_dynamics": NodeService(
        GetObjectDynamics, "Tells mass, friction and the like of an object or a link."
    ),
    "rpbi/change_pybullet_object_dynamics": NodeService(
        ChangeObjectDynamics, "Changes what differs from what the service before tells."
    ),
    "rpbi/change_dynamics": NodeService(
        ChangeDynamicsService, "Changes the keys of `changeDynamics` that the YAML text in it has."
    ),
}
"""What is served, in the order of the handlers."""


class DynamicsServices:
    """Reads dynamics and changes them.

    Args:
        world: The world.
        ask: Reaches the simulation thread.
    """

    def __init__(self, world: World, ask: Requests) -> None:
        self._world, self._ask = world, ask
        handlers = (self._get, self._change_object, self._change)
        for (name, service), handler in zip(DYNAMICS_SERVICES.items(), handlers, strict=True):
            service_type: Any = service.service_type
            rospy.Service(name, service_type, _refusing(handler, service_type._response_class))

    def _get(self, request: GetObjectDynamicsRequest) -> GetObjectDynamicsResponse:
        present = self._ask(lambda: self._world.dynamics(request.object_name))
        return GetObjectDynamicsResponse(True, "", ObjectDynamics(**present._asdict()))

    def _change_object(self, request: ChangeObjectDynamicsRequest) -> ChangeObjectDynamicsResponse:
        asked = request.object_dynamics
        wanted = LinkDynamics(*(getattr(asked, field) for field in LinkDynamics._fields))

        def change() -> str:
            changed = difference(self._world.dynamics(request.object_name), wanted)
            if not changed:
                return "nothing differs"
            self._world.change_dynamics(request.object_name, ChangeDynamics(**changed))
            return f"changed {', '.join(changed)}"

        return ChangeObjectDynamicsResponse(True, self._ask(change))

    def _change(self, request: ChangeDynamicsRequest) -> ChangeDynamicsResponse:
        change = ChangeDynamics.parse(load_configs(request.config, "config"), "config")
        keys = ", ".join(change.kwargs())
        if not keys:
            raise InterfaceError("config: expected keys of changeDynamics, such as lateralFriction; got none")
        self._ask(lambda: self._world.change_dynamics(request.object_name, change))
        return ChangeDynamicsResponse(True, f"changed {keys}")


def _refusing(handler: Callable[[Any], Any], response_type: type) -> Callable[[Any], Any]:
    """Turns what a handler raises for a request that must be refused into `success=False` and its message."""

    def handle(request: Any) -> Any:
        try:
            return handler(request)
        except (InterfaceError, ValueError) as error:
            return response_type(success=False, message=str(error))

    return handle
