"""Services of controllers that live in the tick."""

from cob_srvs.srv import SetStringRequest

from custom_ros_tools.config import load_configs
from custom_ros_tools.errors import ConfigError
from ros_pybullet_interface.srv import SwitchControllersRequest
from rpbi.bodies import Body
from rpbi.bodies.robots.robot import Robot
from rpbi.control.controllers.manager import ControllerSwitch, ControllerUpdate
from rpbi.ros.endpoints import MAX_BYTES, Answer
from rpbi.ros.requests import BodyContext


def robots_with_controllers(body: Body) -> list[str]:
    """Returns the name of a robot that has controllers."""
    return [body.name] if isinstance(body, Robot) and body.config.controllers else []


def controllers(body: Body) -> list[str]:
    """Returns the names of the controllers of a body, as `BODY/CONTROLLER`."""
    return [f"{body.name}/{name}" for name in body.config.controllers] if isinstance(body, Robot) else []


def switch_controllers(context: BodyContext, request: SwitchControllersRequest) -> Answer:
    """Stops and starts controllers of the robot, all at one tick.

    Joints that no controller drives any more hold where they are.

    Raises:
        UnknownNameError: If there is none of a name.
        ValueError: If two would drive one joint; then nothing has changed.
    """
    switch = ControllerSwitch(tuple(request.start), tuple(request.stop))
    if not (switch.start or switch.stop):
        raise ValueError("expected controllers to start or to stop, got none")
    context.act("switch_controllers", switch)
    parts = ((switch.stop, "stopped"), (switch.start, "started"))
    return Answer(True, "; ".join(f"{what}: {', '.join(names)}" for names, what in parts if names))


def set_gains(context: BodyContext, request: SetStringRequest) -> Answer:
    """Changes keys of that controller, such as `{stiffness: 200}`; the others stay.

    One that is active begins again where the robot is.

    Raises:
        ConfigError: If the text is no mapping.
        ValueError: If a value is refused.
    """
    name = context.owner.split("/", 1)[1]
    changes = load_configs(request.data, "data", MAX_BYTES)
    if not changes:
        raise ValueError("data: expected a mapping such as '{stiffness: 200}', got nothing")
    fixed = changes.keys() & {"type", "active", "joints", "state_hz"}
    if fixed:
        raise ValueError(f"cannot be changed while it runs: {', '.join(sorted(fixed))}")
    config = context.body.controllers.config(name)
    try:
        changed = type(config).parse({**config.model_dump(exclude_unset=True), **changes}, context.owner)
    except ConfigError as error:
        raise ValueError(str(error)) from None
    context.act("set_controller_gains", ControllerUpdate(name, changed))
    return Answer(True, f"changed: {', '.join(map(str, changes))}")
