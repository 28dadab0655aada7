"""Requests to the simulation thread with a limited wait."""

import time
from collections.abc import Callable
from concurrent.futures import Future, wait
from typing import TypeVar

import rospy

from custom_ros_tools.errors import InterfaceError
from rpbi.engine.mailbox import ClosedError

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
