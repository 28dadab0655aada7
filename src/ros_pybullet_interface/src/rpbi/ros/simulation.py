"""The simulation loop: requests, ticks, samples out, in step with the wall clock."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from custom_ros_tools.errors import PhysicsError

from ..pacer import Pacer
from ..world import World
from .outlets import Outlet
from .status import ClockOutlet, StatusOutlet

log = logging.getLogger(__name__)

IDLE_PERIOD_S = 0.001
"""Shortest time between two looks at requests while stopped [s]."""


class Simulation:
    """Runs, stops and steps a world on the one thread that owns PyBullet.

    All methods are for that thread; others reach it through the world's mailbox.

    Args:
        world: The world.
        outlets: Where samples go, by type of sample.
        real_time_factor: Simulated seconds per wall second; 0 is as fast as it goes.
        status_hz: Rate of the status [Hz].
        clock: Publishes /clock if stamps are simulated time.
        helpers: Called at every pass; they must return at once.
        facts: Tells what else the diagnostics should have.
    """

    def __init__(
        self,
        world: World,
        outlets: Mapping[type, Outlet],
        real_time_factor: float,
        status_hz: float,
        clock: ClockOutlet | None = None,
        helpers: Sequence[Callable[[], None]] = (),
        facts: Callable[[], Mapping[str, str]] = dict,
    ) -> None:
        self.world = world
        self.running = False
        self._broken = False
        self.passes = 0
        """Grows as long as the loop is alive."""
        self._outlets = outlets
        self._distinct_outlets = list(dict.fromkeys(outlets.values()))
        self._clock = clock
        self._helpers = helpers
        self._pacer = Pacer(world.clock.dt_s, real_time_factor)
        self._idle_pacer = Pacer(max(world.clock.dt_s, IDLE_PERIOD_S))
        self._idle_ticks_a_pass = max(1, round(IDLE_PERIOD_S / world.clock.dt_s))
        self._idle_tick = 0
        self._status = StatusOutlet(world.clock, self._pacer, status_hz, real_time_factor, facts)

    def start(self) -> bool:
        """Lets the world run.

        Returns:
            False if it runs already.
        """
        if self.running:
            return False
        self.running, self._broken = True, False
        self._pacer.restart()
        self._status.publish(True)
        return True

    def stop(self) -> bool:
        """Lets the world stand still, with all of its last tick told.

        Returns:
            False if it stands still already.
        """
        if not self.running:
            return False
        self._halt()
        return True

    def step(self) -> tuple[int, int]:
        """Goes one tick on; when it returns, everything of that tick has been handed to every subscriber.

        Returns:
            The new tick and its stamp [ns].

        Raises:
            PhysicsError: If something in the world is not finite any more.
        """
        self._broken = False
        self._status.publish(True)
        samples = self.world.step()
        if self._clock is not None:
            self._clock.publish_now()
        self._publish(samples + self.world.read_rest())
        self._status.publish(False)
        return self.world.clock.tick, self.world.clock.stamp_ns

    def run(self, is_over: Callable[[], bool]) -> None:
        """Loops until it is over."""
        while not is_over():
            self.passes += 1
            self.world.mailbox.run_requests()
            try:
                if self.running:
                    self._advance()
                else:
                    self._idle()
            except PhysicsError as error:
                self._break_off(error)
            for help_out in self._helpers:
                help_out()
            self._status.spin(self.running)
            (self._pacer if self.running else self._idle_pacer).wait()

    def _advance(self) -> None:
        if not self._pacer.is_due():
            return
        samples = self.world.step()
        if self._clock is not None:
            self._clock.publish_tick()
        if samples:
            self._publish(samples)

    def _break_off(self, error: PhysicsError) -> None:
        """Stands still, and tells no more of a world that is broken; until somebody starts or steps it again."""
        log.error("simulation stopped: %s", error)
        self.running, self._broken = False, True
        self.world.halt("the simulation broke off")
        self._idle_tick = self.world.clock.tick
        if self._clock is not None:
            self._clock.publish_now()
        self._status.publish(False)

    def _halt(self) -> None:
        self.running = False
        self.world.pause("the simulation was stopped")
        self._idle_tick = self.world.clock.tick
        if self._clock is not None:
            self._clock.publish_now()
        self._publish(self.world.read_rest())
        self._status.publish(False)

    def _idle(self) -> None:
        """Keeps a world that stands still visible to those who come late, without repeating a stamp."""
        if not self._idle_pacer.is_due():
            return
        if self._clock is not None:
            self._clock.repeat()
        if self._broken:
            return
        self.world.take_inputs()
        if self._clock is not None:
            self._publish(self.world.read_rest())
            for outlet in self._distinct_outlets:
                outlet.serve_late()
        else:
            since, self._idle_tick = self._idle_tick, self._idle_tick + self._idle_ticks_a_pass
            self.world.clock.restamp()
            self._publish(self.world.read_idle(self._idle_tick, since))

    def _publish(self, samples: list[Any]) -> None:
        stamp_ns = self.world.clock.stamp_ns
        for sample in samples:
            self._outlets[type(sample)].publish(sample, stamp_ns)
        for outlet in self._distinct_outlets:
            outlet.flush()
