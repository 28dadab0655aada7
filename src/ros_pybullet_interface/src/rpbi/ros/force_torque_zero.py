"""The service that makes a force-torque sensor show zero."""

from __future__ import annotations

from concurrent.futures import wait

from std_srvs.srv import EmptyRequest, EmptyResponse

from custom_ros_tools.errors import InterfaceError

from ..bodies import Body
from ..bodies.jointed import JointedBody
from ..sensors.zeroing import Zeroing
from .body_context import BodyContext

SAMPLES = 100
"""How many samples are averaged."""
LOOK_AGAIN_AFTER_S = 0.2
"""How often it is seen whether samples still come [s] of wall time."""
_SUFFIX = "/ft_sensor"


def force_torque_suffixes(body: Body) -> list[str]:
    """Returns what follows `rpbi/NAME/` in the service of each sensor of a body."""
    sensors = body.force_torque_sensors if isinstance(body, JointedBody) else ()
    return [f"{sensor.joint.name}{_SUFFIX}" for sensor in sensors]


def zero_force_torque(context: BodyContext, _: EmptyRequest) -> EmptyResponse:
    """Averages the coming samples and takes the mean for zero; answers when that is done.

    Raises:
        InterfaceError: If the simulation is stopped, before or meanwhile, or the robot goes; the old zero stays then.
    """
    joint = context.suffix.removesuffix(_SUFFIX)
    body = context.body
    sensor = next(each for each in body.force_torque_sensors if each.joint.name == joint)

    def start() -> Zeroing:
        if not context.simulation.running:
            raise InterfaceError("the simulation is stopped: start it, else there are no samples to average")
        zeroing: Zeroing = sensor.zero(SAMPLES)
        return zeroing

    def check() -> None:
        if not context.simulation.running and not zeroing.mean.done():
            sensor.cancel_zeroing()
            raise InterfaceError(f"the simulation was stopped before {SAMPLES} samples had come; the old zero stays")

    zeroing = context.ask_body(start, body)
    while not wait([zeroing.mean], timeout=LOOK_AGAIN_AFTER_S).done:
        context.ask_body(check, body)
    return EmptyResponse()
