"""Requests from other threads to the simulation thread, and the context of a service or topic of a body."""

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
"""Longest wait [s], in wall time, for the next pass of the simulation loop; beyond it, a waiting request fails."""


class Requests:
    """Makes the simulation thread call a function, and waits for the result."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation

    def __call__(self, call: Callable[[], T], even_if_busy: bool = False) -> T:
        """Makes the simulation thread call a function; returns the function's result or raises its exception.

        If the caller is in the simulation thread, the function is called directly.

        Args:
            call: The function.
            even_if_busy: Whether to call the function even while the world is being restored.

        Raises:
            InterfaceError: If the world is being restored, the simulation has ended, the node shuts down or the
                simulation loop makes no progress.
        """
        if self._simulation.is_own_thread:
            return call()
        return self.wait_for(self._simulation.world.mailbox.request(call, even_if_busy))

    def wait_for(self, future: Future[T]) -> T:
        """Waits for a future that the simulation thread completes; returns the future's result or raises its exception.

        Raises:
            InterfaceError: If the simulation has ended, the node shuts down or the simulation loop makes no
                progress.
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
    """The body that a service or topic acts on, for handlers that run outside of the simulation thread.

    Attributes:
        name: Name of the body.
        owner: Text that replaces `{name}` in the name of the service or topic: the body's name, or `BODY/JOINT` for a
            force-torque sensor, or `BODY/CONTROLLER` for a controller.
        simulation: The loop that runs the world.
        ask: Makes the simulation thread call a function.
    """

    name: str
    owner: str
    simulation: Simulation
    ask: Requests

    @property
    def world(self) -> World:
        """The world that contains the body."""
        return self.simulation.world

    @property
    def body(self) -> Any:
        """The `Body` object that has this name at present; a reset may replace this object by another.

        Only the simulation thread may read the body's PyBullet state.

        Raises:
            UnknownNameError: If the body was removed.
            InterfaceError: If the simulation has ended.
        """
        body = self.world.bodies.get(self.name)
        if body is None:  # a reset may be running; it is over when the simulation thread answers
            body = self.ask(lambda: self.world.bodies.get(self.name))
        if body is None:
            raise UnknownNameError("object", self.name, list(self.world.bodies))
        return body

    def ask_body(self, call: Callable[[], T], body: Any = None) -> T:
        """Makes the simulation thread call a function that uses the body; returns its result or raises its exception.

        Args:
            call: The function, without arguments.
            body: The `Body` object that the function uses. By default, the value of `self.body` at the start of
                `ask_body`.

        Raises:
            UnknownNameError: If the body was removed before `call` could run.
            InterfaceError: If a reset replaced the `Body` object before `call` could run, or the simulation has ended
                or makes no progress.
        """
        asked = self.body if body is None else body

        def checked() -> T:
            if self.body is not asked:
                raise InterfaceError("the world was reset meanwhile; ask again")
            return call()

        return self.ask(checked)

    def act(self, what: str, value: Any, do: Callable[[Any], Any] | None = None) -> Any:
        """Makes the simulation thread call `World.act`, which applies an action to the body and records the action."""
        return self.ask_body(lambda: self.world.act(self.name, what, value, do))
