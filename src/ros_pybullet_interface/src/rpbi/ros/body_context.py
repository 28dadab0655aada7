"""What a service, topic or other part of a body needs to reach it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar

from custom_ros_tools.errors import UnknownNameError

from ..bodies import Body
from ..world import World
from .requests import Requests
from .simulation import Simulation

T = TypeVar("T")


class BodyContext(NamedTuple):
    """A body and the way to it.

    Attributes:
        body: The body; a robot where only robots are served. Its PyBullet state is for the simulation thread alone.
        suffix: What follows `rpbi/NAME/` in the name of the service or topic.
        world: The world it is in.
        simulation: The loop that runs the world.
        ask: Reaches the simulation thread.
    """

    body: Any
    suffix: str
    world: World
    simulation: Simulation
    ask: Requests

    def ask_body(self, call: Callable[[], T]) -> T:
        """Has the simulation thread make a call that uses the body; returns its result or raises its exception.

        Raises:
            UnknownNameError: If the body has gone meanwhile.
            InterfaceError: If the simulation has ended or makes no progress.
        """

        def checked() -> T:
            bodies: dict[str, Body] = self.world.bodies
            if bodies.get(self.body.name) is not self.body:
                raise UnknownNameError("object", self.body.name, list(bodies))
            return call()

        return self.ask(checked)
