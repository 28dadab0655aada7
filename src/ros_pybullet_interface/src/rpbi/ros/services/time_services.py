"""The services that step a world by many ticks, reset it and tell the hash of its state."""

from __future__ import annotations

from collections.abc import Callable

import rospy
from std_srvs.srv import Trigger, TriggerRequest, TriggerResponse

from custom_ros_tools.errors import InterfaceError
from ros_pybullet_interface.srv import (
    GetStateHash,
    GetStateHashRequest,
    GetStateHashResponse,
    StepN,
    StepNRequest,
    StepNResponse,
)
from rpbi.ros.headers import to_ros_time
from rpbi.ros.requests import Requests
from rpbi.ros.simulation import Simulation

from .node_services import NodeService

TIME_SERVICES: dict[str, NodeService] = {
    "rpbi/step_n": NodeService(StepN, "Goes many ticks on, as fast as it goes, if the world stands still."),
    "rpbi/reset": NodeService(Trigger, "Makes the world what it was at its start, to the last bit; stamps go on."),
    "rpbi/get_state_hash": NodeService(GetStateHash, "Tells a text that is the same for worlds in the same state."),
}
"""What is served, in the order of the handlers."""


class TimeServices:
    """Steps by many ticks, resets, and tells the hash of the state.

    Args:
        simulation: What to control.
        ask: Reaches the simulation thread.
        reset: Resets the world and all that belongs to it.
    """

    def __init__(self, simulation: Simulation, ask: Requests, reset: Callable[[], None]) -> None:
        self._simulation, self._ask, self._do_reset = simulation, ask, reset
        handlers = (self._step_n, self._reset, self._state_hash)
        for (name, service), handler in zip(TIME_SERVICES.items(), handlers, strict=True):
            rospy.Service(name, service.service_type, handler)

    def _step_n(self, request: StepNRequest) -> StepNResponse:
        try:
            tick, stamp_ns = self._ask.wait_for(self._ask(lambda: self._simulation.step_n(request.steps)))
            return StepNResponse(True, f"{request.steps} ticks done", tick, to_ros_time(stamp_ns))
        except InterfaceError as error:
            clock = self._simulation.world.clock
            return StepNResponse(False, str(error), clock.tick, to_ros_time(clock.stamp_ns))

    def _reset(self, _: TriggerRequest) -> TriggerResponse:
        try:
            self._do_reset()
        except InterfaceError as error:
            return TriggerResponse(success=False, message=str(error))
        return TriggerResponse(success=True, message="the world is as configured")

    def _state_hash(self, _: GetStateHashRequest) -> GetStateHashResponse:
        world = self._simulation.world

        def read() -> GetStateHashResponse:
            stamp = to_ros_time(world.clock.stamp_ns)
            return GetStateHashResponse(True, "", world.clock.tick, stamp, world.resets, world.state_hash())

        try:
            return self._ask(read)
        except InterfaceError as error:
            return GetStateHashResponse(success=False, message=str(error))
