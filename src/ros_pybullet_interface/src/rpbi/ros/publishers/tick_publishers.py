"""Publishes everything of a tick: the time first, then the samples."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rpbi.world import World

from .status import ClockPublisher
from .topic_publisher import SamplePublisher


class TickPublisher:
    """Publishes the ticks of a world.

    Args:
        world: The world.
        publishers: Where samples go, one for each type of sample; there may be more later.
        clock: Publishes /clock if stamps are simulated time.
        idle_ticks: How many ticks pass between two calls of `publish_idle` were the world running.
    """

    def __init__(
        self, world: World, publishers: Mapping[type, SamplePublisher], clock: ClockPublisher | None, idle_ticks: int
    ) -> None:
        self._world = world
        self._publishers = publishers
        self._clock = clock
        self._idle_ticks = idle_ticks
        self._idle_tick = 0
        """The tick at which the world would be, had it not stood still."""

    def publish_tick(self, samples: list[Any]) -> None:
        """Publishes a tick and the samples that were due."""
        if self._clock is not None:
            self._clock.publish_tick()
        if samples:
            self._publish(samples)

    def publish_all(self, samples: list[Any]) -> None:
        """Publishes the last tick before standing still: all of it, whatever is due."""
        self.publish_last_time()
        self._publish(samples + self._world.read_rest())

    def publish_last_time(self) -> None:
        """Publishes the time of the last tick before standing still, and nothing of a world that may be broken."""
        self._idle_tick = self._world.clock.tick
        if self._clock is not None:
            self._clock.publish_now()

    def repeat_time(self) -> None:
        """Repeats the time for those who come late."""
        if self._clock is not None:
            self._clock.repeat()

    def publish_idle(self) -> None:
        """Keeps a world that stands still visible to those who come late, without repeating a stamp."""
        if self._clock is not None:
            self._publish(self._world.read_rest())
            for publisher in self._publishers.values():
                publisher.serve_late()
        else:
            since, self._idle_tick = self._idle_tick, self._idle_tick + self._idle_ticks
            self._world.clock.restamp()
            self._publish(self._world.read_idle(self._idle_tick, since))

    def restart(self) -> None:
        """Drops what is kept of a world before its reset, and publishes how it is now."""
        for publisher in self._publishers.values():
            publisher.restart()
        self.publish_all([])

    def _publish(self, samples: list[Any]) -> None:
        stamp_ns = self._world.clock.stamp_ns
        for sample in samples:
            self._publishers[type(sample)].publish(sample, stamp_ns)
        for publisher in self._publishers.values():
            publisher.flush()
