"""The services that start, stop, step and reset the world, and return the hash of its state."""

from __future__ import annotations

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
from rpbi.engine.clock import NS_PER_S
from rpbi.ros.endpoints import Service
from rpbi.ros.headers import to_ros_time

from .node_context import NodeContext


def _start(node: NodeContext, _: TriggerRequest) -> TriggerResponse:
    has_started = node.ask(node.simulation.start)
    return TriggerResponse(has_started, "started" if has_started else "already running")


def _stop(node: NodeContext, _: TriggerRequest) -> TriggerResponse:
    has_stopped = node.ask(node.simulation.stop)
    return TriggerResponse(has_stopped, "stopped" if has_stopped else "already stopped")


def _step(node: NodeContext, _: TriggerRequest) -> TriggerResponse:
    tick, stamp_ns = node.ask(node.simulation.step)
    seconds, nanoseconds = divmod(stamp_ns, NS_PER_S)
    return TriggerResponse(True, f"tick {tick}, stamp {seconds}.{nanoseconds:09d}")


def _step_n(node: NodeContext, request: StepNRequest) -> StepNResponse:
    try:
        tick, stamp_ns = node.ask.wait_for(node.ask(lambda: node.simulation.step_n(request.steps)))
        return StepNResponse(True, f"{request.steps} ticks done", tick, to_ros_time(stamp_ns))
    except InterfaceError as error:
        clock = node.simulation.world.clock
        return StepNResponse(False, str(error), clock.tick, to_ros_time(clock.stamp_ns))


def _reset(node: NodeContext, _: TriggerRequest) -> TriggerResponse:
    node.objects.reset()
    return TriggerResponse(True, "the world is as configured")


def _state_hash(node: NodeContext, _: GetStateHashRequest) -> GetStateHashResponse:
    world = node.simulation.world

    def read() -> GetStateHashResponse:
        stamp = to_ros_time(world.clock.stamp_ns)
        return GetStateHashResponse(True, "", world.clock.tick, stamp, world.resets, world.state_hash())

    return node.ask(read)


TIME_SERVICES = (
    Service("rpbi/start", Trigger, _start, "Lets the world run; `success` is false if it does so already."),
    Service("rpbi/stop", Trigger, _stop, "Lets the world stand still; `success` is false if it does so already."),
    Service(
        "rpbi/step",
        Trigger,
        _step,
        "Goes one tick on, if the world stands still; the message is `tick N, stamp S` [s].",
    ),
    Service("rpbi/step_n", StepN, _step_n, "Goes many ticks on, as fast as it goes, if the world stands still."),
    Service("rpbi/reset", Trigger, _reset, "Makes the world what it was at its start, to the last bit; stamps go on."),
    Service(
        "rpbi/get_state_hash",
        GetStateHash,
        _state_hash,
        "Returns a text that is the same for worlds in the same state.",
    ),
)
