"""Everything that is told of a tick: the time first, then the samples."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rpbi.world import World

from .publishers import Outlet
from .status import ClockOutlet


class TickOutlets:
    """Tells the ticks of a world.

    Args:
        world: The world.
        outlets: Where samples go, one for each type of sample; there may be more later.
        clock: Publishes /clock if stamps are simulated time.
        idle_ticks: How many ticks pass between two calls of `tell_idle` were the world running.
    """

    def __init__(
        self, world: World, outlets: Mapping[type, Outlet], clock: ClockOutlet | None, idle_ticks: int
    ) -> None:
        self._world = world
        self._outlets = outlets
        self._clock = clock
        self._idle_ticks = idle_ticks
        self._idle_tick = 0
        """The tick at which the world would be, had it not stood still."""

    def tell(self, samples: list[Any]) -> None:
        """Tells a tick and the samples that were due."""
        if self._clock is not None:
            self._clock.publish_tick()
        if samples:
            self._publish(samples)

    def tell_all(self, samples: list[Any]) -> None:
        """Tells the last tick before standing still: all of it, whatever is due."""
        self.tell_end()
        self._publish(samples + self._world.read_rest())

    def tell_end(self) -> None:
        """Tells the time of the last tick before standing still, and nothing of a world that may be broken."""
        self._idle_tick = self._world.clock.tick
        if self._clock is not None:
            self._clock.publish_now()

    def tell_time_again(self) -> None:
        """Repeats the time for those who come late."""
        if self._clock is not None:
            self._clock.repeat()

    def tell_idle(self) -> None:
        """Keeps a world that stands still visible to those who come late, without repeating a stamp."""
        if self._clock is not None:
            self._publish(self._world.read_rest())
            for outlet in self._outlets.values():
                outlet.serve_late()
        else:
            since, self._idle_tick = self._idle_tick, self._idle_tick + self._idle_ticks
            self._world.clock.restamp()
            self._publish(self._world.read_idle(self._idle_tick, since))

    def restart(self) -> None:
        """Drops what is kept of a world before its reset, and tells how it is now."""
        for outlet in self._outlets.values():
            outlet.restart()
        self.tell_all([])

    def _publish(self, samples: list[Any]) -> None:
        stamp_ns = self._world.clock.stamp_ns
        for sample in samples:
            self._outlets[type(sample)].publish(sample, stamp_ns)
        for outlet in self._outlets.values():
            outlet.flush()
