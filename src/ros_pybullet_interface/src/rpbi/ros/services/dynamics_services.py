"""The services that return and change how objects and links behave in contact and motion."""

from __future__ import annotations

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
from rpbi.ros.endpoints import Service

from .node_context import NodeContext


def _get(node: NodeContext, request: GetObjectDynamicsRequest) -> GetObjectDynamicsResponse:
    present = node.ask(lambda: node.simulation.world.dynamics(request.object_name))
    return GetObjectDynamicsResponse(True, "", ObjectDynamics(**present._asdict()))


def _change_object(node: NodeContext, request: ChangeObjectDynamicsRequest) -> ChangeObjectDynamicsResponse:
    world, asked = node.simulation.world, request.object_dynamics
    wanted = LinkDynamics(*(getattr(asked, field) for field in LinkDynamics._fields))

    def change() -> str:
        changed = difference(world.dynamics(request.object_name), wanted)
        if not changed:
            return "nothing differs"
        world.change_dynamics(request.object_name, ChangeDynamics(**changed))
        return f"changed {', '.join(changed)}"

    return ChangeObjectDynamicsResponse(True, node.ask(change))


def _change(node: NodeContext, request: ChangeDynamicsRequest) -> ChangeDynamicsResponse:
    change = ChangeDynamics.parse(load_configs(request.config, "config"), "config")
    keys = ", ".join(change.kwargs())
    if not keys:
        raise InterfaceError("config: expected keys of changeDynamics, such as lateralFriction; got none")
    node.ask(lambda: node.simulation.world.change_dynamics(request.object_name, change))
    return ChangeDynamicsResponse(True, f"changed {keys}")


DYNAMICS_SERVICES = (
    Service(
        "rpbi/get_pybullet_object_dynamics",
        GetObjectDynamics,
        _get,
        "Returns mass, friction and the like of an object or a link.",
    ),
    Service(
        "rpbi/change_pybullet_object_dynamics",
        ChangeObjectDynamics,
        _change_object,
        "Changes what differs from what the service before returns.",
    ),
    Service(
        "rpbi/change_dynamics",
        ChangeDynamicsService,
        _change,
        "Changes the keys of `changeDynamics` that the YAML text in it has.",
    ),
)
