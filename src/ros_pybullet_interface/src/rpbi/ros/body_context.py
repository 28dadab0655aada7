"""Context of services and topics of a body."""

from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar

from custom_ros_tools.errors import InterfaceError, UnknownNameError
from rpbi.ros.requests import Requests
from rpbi.ros.simulation import Simulation
from rpbi.world import World

T = TypeVar("T")


class BodyContext(NamedTuple):
    """A body, and access to it from other threads.

    Attributes:
        name: Name of the body.
        owner: Value of `{name}` in the name of the service or topic: the body, or a sensor as `BODY/JOINT`.
        simulation: The loop that runs the world.
        ask: Calls a function in the simulation thread.
    """

    name: str
    owner: str
    simulation: Simulation
    ask: Requests

    @property
    def world(self) -> World:
        """The world it is in."""
        return self.simulation.world

    @property
    def body(self) -> Any:
        """The present body, which may be another object after each reset; a robot if only robots are served.

        Its PyBullet state is for the simulation thread alone.

        Raises:
            UnknownNameError: If it has gone.
            InterfaceError: If it cannot be found out, since the simulation has ended.
        """
        body = self.world.bodies.get(self.name)
        if body is None:  # a reset may be running; it is over when the simulation thread answers
            body = self.ask(lambda: self.world.bodies.get(self.name))
        if body is None:
            raise UnknownNameError("object", self.name, list(self.world.bodies))
        return body

    def ask_body(self, call: Callable[[], T], body: Any = None) -> T:
        """Calls a function that uses the body in the simulation thread; returns its result or raises its exception.

        Args:
            call: The call.
            body: The body that it uses, if it was looked up before.

        Raises:
            UnknownNameError: If the body has gone meanwhile.
            InterfaceError: If the world was reset meanwhile, the simulation has ended or makes no progress.
        """
        asked = self.body if body is None else body

        def checked() -> T:
            if self.body is not asked:
                raise InterfaceError("the world was reset meanwhile; ask again")
            return call()

        return self.ask(checked)

    def act(self, what: str, value: Any, do: Callable[[Any], Any] | None = None) -> Any:
        """Applies a replayable action to the body in the simulation thread; see `World.act`."""
        return self.ask_body(lambda: self.world.act(self.name, what, value, do))
