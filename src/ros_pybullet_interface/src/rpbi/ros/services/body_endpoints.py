"""All that a body has in ROS beside its samples and inputs."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack

from rpbi.bodies import Body
from rpbi.ros.requests import Requests
from rpbi.ros.robots.description import publish_description
from rpbi.ros.robots.trajectory_action import open_trajectory_action
from rpbi.ros.simulation import Simulation
from rpbi.world import World

from .body_context import BodyContext
from .body_services import BODY_SERVICES, open_service
from .body_topics import BODY_TOPICS, open_topic

Part = Callable[[BodyContext], Callable[[], None] | None]
"""Opens something for a body, if the body has it, and returns what closes it."""

BODY_PARTS: tuple[Part, ...] = (publish_description, open_trajectory_action)
"""What is neither a plain service nor a plain topic."""


class BodyEndpoints:
    """Opens services, topics and other parts of bodies, and closes them with the body.

    Args:
        world: The world.
        simulation: The loop that runs it.
        ask: Reaches the simulation thread.
    """

    def __init__(self, world: World, simulation: Simulation, ask: Requests) -> None:
        self._world, self._simulation, self._ask = world, simulation, ask
        self._open: dict[str, ExitStack] = {}

    def open(self, body: Body) -> None:
        """Opens all that a body has; when it raises, nothing is left open."""
        with ExitStack() as stack:
            for part in BODY_PARTS:
                close = part(self._context(body, ""))
                if close is not None:
                    stack.callback(close)
            for topic in BODY_TOPICS:
                for suffix in topic.suffixes(body):
                    stack.callback(open_topic(topic, self._context(body, suffix)).unregister)
            for service in BODY_SERVICES:
                for suffix in service.suffixes(body):
                    stack.callback(open_service(service, self._context(body, suffix)).shutdown, "its body has gone")
            self._open[body.name] = stack.pop_all()

    def close(self, name: str) -> None:
        """Closes all that a body had."""
        stack = self._open.pop(name, None)
        if stack is not None:
            stack.close()

    def _context(self, body: Body, suffix: str) -> BodyContext:
        return BodyContext(body.name, suffix, self._world, self._simulation, self._ask)
