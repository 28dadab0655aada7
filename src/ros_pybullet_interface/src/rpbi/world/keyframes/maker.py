"""Makes keyframes of a running world in small parts, between ticks."""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from typing import Any

from custom_ros_tools.errors import InterfaceError
from rpbi.world.saved.state import WorldState

log = logging.getLogger(__name__)


class KeyframeMaker:
    """Makes keyframes of a running `World`, periodically and on request; each call of `poll` makes one part.

    If a periodic keyframe fails, a warning is logged, and periodic keyframes stop until the world is reset.

    Args:
        world: The world.
        every_s: Period [s] of keyframes in simulated time; 0 means no periodic keyframes.

    Attributes:
        longest_s: Maximum wall time [s] that a part of the last keyframe took.
    """

    def __init__(self, world: Any, every_s: float) -> None:
        self._world = world
        self._ticks = max(1.0, round(every_s / world.clock.dt_s)) if every_s else math.inf
        self.longest_s = 0.0
        self._parts: Iterator[None] | None = None
        self._asked: list[Future[WorldState]] = []
        self._is_refused = False
        self._resets, self._last = world.resets, world.clock.tick

    def save(self) -> Future[WorldState]:
        """Requests a keyframe, and returns a future of the saved state.

        The next calls of `poll` make the keyframe. If the keyframe fails, the future raises an InterfaceError.
        """
        asked: Future[WorldState] = Future()
        self._asked.append(asked)
        return asked

    def poll(self) -> None:
        """If a keyframe is due, requested or in progress, makes its next part.

        Does nothing while the world is busy, see `Mailbox.hold`.
        """
        world = self._world
        if world.mailbox.is_held:
            return
        if world.resets != self._resets:
            self._parts, self._is_refused = None, False
            self._resets, self._last = world.resets, world.clock.tick
        if self._parts is None:
            is_due = not self._is_refused and world.clock.tick - self._last >= self._ticks
            if not is_due and not self._asked:
                return
            self._parts, self.longest_s, self._last = world.keyframe_in_parts(), 0.0, world.clock.tick
        begin_s = time.perf_counter()
        try:
            next(self._parts)
        except StopIteration:
            self._finish(world.save)
        except InterfaceError as error:
            self._refuse(error)
            return
        self.longest_s = max(self.longest_s, time.perf_counter() - begin_s)
        if self._parts is None:
            log.debug("keyframe at tick %d: its longest part took %.3g s", world.clock.tick, self.longest_s)

    def _refuse(self, error: InterfaceError) -> None:
        if not self._asked:
            self._is_refused = True
            log.warning("keyframe_every_s: no keyframe at tick %d, nor later: %s", self._world.clock.tick, error)

        def fail() -> WorldState:
            raise error

        self._finish(fail)

    def _finish(self, state: Callable[[], WorldState]) -> None:
        """Ends a keyframe, and completes the futures of all requests with the result or InterfaceError from `state`."""
        asked, self._asked, self._parts = self._asked, [], None
        for each in asked:
            if each.set_running_or_notify_cancel():
                try:
                    each.set_result(state())
                except InterfaceError as error:
                    each.set_exception(error)
