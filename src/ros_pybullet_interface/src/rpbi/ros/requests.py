"""Requests to the simulation thread, and the body that a service or topic acts on."""

import time
from collections.abc import Callable
from concurrent.futures import Future, wait
from typing import Any, NamedTuple, TypeVar

import rospy

from custom_ros_tools.errors import InterfaceError, UnknownNameError
from rpbi.engine.mailbox import ClosedError
from rpbi.world import World

from .simulation import Simulation

T = TypeVar("T")

GIVE_UP_AFTER_S = 30.0
"""Longest wait of a request for a pass of the loop [s] of wall time; beyond it, the request fails."""


class Requests:
    """Makes the simulation thread call functions, and waits for their results."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation

    def __call__(self, call: Callable[[], T], even_if_busy: bool = False) -> T:
        """Returns what the call returns, or raises what it raises; on the simulation thread it is made at once.

        Args:
            call: The call.
            even_if_busy: Whether it is made even while the world is restored.

        Raises:
            InterfaceError: If the world is being restored, the simulation has ended, the node shuts down or the loop
                makes no progress.
        """
        if self._simulation.is_own_thread:
            return call()
        return self.wait_for(self._simulation.world.mailbox.request(call, even_if_busy))

    def wait_for(self, future: Future[T]) -> T:
        """Waits for a future of the simulation thread; returns its result or raises its error.

        Raises:
            InterfaceError: If the simulation has ended, the node shuts down or the loop makes no progress.
        """
        passes, progress_s = self._simulation.passes, time.monotonic()
        while not wait([future], timeout=0.2).done:
            if self._simulation.passes != passes:
                passes, progress_s = self._simulation.passes, time.monotonic()
            if rospy.is_shutdown() and future.cancel():
                raise InterfaceError("the node is shutting down")
            if time.monotonic() - progress_s > GIVE_UP_AFTER_S and future.cancel():
                raise InterfaceError(f"the simulation made no progress for {GIVE_UP_AFTER_S:g} s")
        try:
            return future.result()
        except ClosedError as error:
            raise InterfaceError(str(error)) from None


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
            UnknownNameError: If it was removed.
            InterfaceError: If the simulation has ended.
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
            UnknownNameError: If the body was removed meanwhile.
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
