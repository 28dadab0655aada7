"""`rpbi/state`: how the simulation is doing, and hashes of its state."""

from __future__ import annotations

import time

from custom_ros_tools.ros.lifecycle.wall_timer import WallRate
from ros_pybullet_interface.msg import SimulationState
from rpbi.engine.clock import Schedule
from rpbi.engine.pacer import Pacer
from rpbi.ros.endpoints import Topic
from rpbi.ros.headers import to_ros_time
from rpbi.world import World

from .topics import FastTopic

STATE = Topic(
    "rpbi/state",
    SimulationState,
    meaning="Tick, time, real-time factor and hash of the state; `state_hz`, `state_hash_hz`.",
    key="state_hz",
)
WINDOW_S = 1.0
"""Over how long the real-time factor is measured at least [s] of wall time."""


class StatePublisher:
    """Publishes how the simulation is doing, at a rate of the wall clock, and its hash, at a rate of the world's.

    Args:
        world: The world.
        pacer: What keeps it in step with the wall clock.
    """

    def __init__(self, world: World, pacer: Pacer) -> None:
        self._world, self._pacer = world, pacer
        config = world.config
        self._rate = WallRate(config.state_hz)
        self._schedule = Schedule(config.state_hash_hz, world.clock.dt_ns) if config.state_hash_hz else None
        self._topic = FastTopic(STATE.name, SimulationState)
        self._factor = 0.0
        self._moves = False
        self.is_stepping = False
        """Whether the ticks are those of a request."""
        self.restart()

    def restart(self) -> None:
        """Publishes a world that was built or reset, with its hash."""
        tick = self._world.clock.tick
        self._hash_tick = None if self._schedule is None else self._schedule.next_due(tick)
        self._begin_window()
        self._publish(self._schedule is not None)

    def take_tick(self) -> None:
        """Publishes the hash of a tick, if it is due."""
        tick = self._world.clock.tick
        if self._schedule is not None and self._hash_tick is not None and tick >= self._hash_tick:
            self._hash_tick = self._schedule.next_due(tick)
            self._publish(with_hash=True)

    def spin(self, moves: bool) -> None:
        """Publishes what is due by the wall clock, and at once when the world starts or stops.

        Args:
            moves: Whether the world runs, or is stepping.
        """
        now_s = time.monotonic()
        if moves != self._moves:
            self._moves = moves
            self._begin_window()
        elif moves and now_s - self._window_s >= WINDOW_S:
            ticks = self._world.clock.tick - self._window_tick
            self._factor = ticks * self._world.clock.dt_s / (now_s - self._window_s)
            self._window_s, self._window_tick = now_s, self._world.clock.tick
        if self._rate.is_due():
            self._publish()

    def _begin_window(self) -> None:
        """Measures the real-time factor from now on; until it is known, it is 0."""
        self._factor = 0.0
        self._window_s, self._window_tick = time.monotonic(), self._world.clock.tick

    def _publish(self, with_hash: bool = False) -> None:
        if not self._topic.has_subscribers:
            return
        clock = self._world.clock
        message = SimulationState(
            running=self._moves and not self.is_stepping,
            stepping=self.is_stepping,
            tick=clock.tick,
            simulated_time=clock.time_s,
            real_time_factor_asked=self._world.config.real_time_factor,
            real_time_factor=self._factor,
            overruns=self._pacer.overruns,
            lost_time=self._pacer.lost_s,
            resets=self._world.resets,
            commands=self._world.commands.count,
            state_hash=self._world.state_hash() if with_hash else "",
        )
        message.header.stamp = to_ros_time(clock.stamp_ns)
        self._topic.publish(message)
