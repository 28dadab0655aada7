"""Paces ticks by the wall clock, and explains why a world is too slow."""

from __future__ import annotations

import time
from typing import NamedTuple

MAX_DEBT_S = 0.25
"""Largest delay [s] of a tick that later ticks recover. A larger delay is counted as lost time instead."""

LEAST_SHARE = 0.8
"""Share of a processor below which lack of processor time is reported as the reason for a slow world."""

MAX_SLEEP_S = 0.005
"""Longest sleep [s] between two checks for requests."""


class Pacer:
    """Decides by the wall clock when the next tick is due, and counts late ticks.

    Deadlines are absolute, so delays do not accumulate. After a late tick, the next ticks follow at once until the
    delay is recovered. A delay beyond MAX_DEBT_S is not recovered.

    Args:
        dt_s: Length of a tick [s], in simulated time.
        real_time_factor: Simulated seconds per wall second; 0 to run as fast as possible.

    Attributes:
        real_time_factor: The real-time factor that was set last.
    """

    def __init__(self, dt_s: float, real_time_factor: float = 1.0) -> None:
        self._dt_s = dt_s
        self.overruns = 0
        """Number of ticks that began more than one period late."""
        self.lost_s = 0.0
        """Sum [s] of the delays that were not recovered, in wall time."""
        self.set_factor(real_time_factor)

    def set_factor(self, real_time_factor: float) -> None:
        """Sets the real-time factor, and calls `restart`."""
        self.real_time_factor = real_time_factor
        self._period_s = self._dt_s / real_time_factor if real_time_factor else 0.0
        self.restart()

    def restart(self) -> None:
        """Sets the next deadline to now, for example when a stopped world continues; restarts `measure`."""
        self._deadline_s = time.monotonic()
        self._window_start_s = self._deadline_s
        self._window_ticks = 0

    def is_due(self) -> bool:
        """Returns whether the next tick is due. If so, counts the tick, and moves the deadline by one period."""
        if not self._period_s:
            self._window_ticks += 1
            return True
        late_s = time.monotonic() - self._deadline_s
        if late_s < 0.0:
            return False
        if late_s > self._period_s:
            self.overruns += 1
        if late_s > MAX_DEBT_S:
            self.lost_s += late_s
            self._deadline_s += late_s
        self._deadline_s += self._period_s
        self._window_ticks += 1
        return True

    @property
    def period_s(self) -> float:
        """Wall time of a tick [s]; 0 if ticks are made as fast as possible."""
        return self._period_s

    @property
    def is_free(self) -> bool:
        """Whether ticks are made as fast as possible."""
        return not self._period_s

    def count(self, ticks: int) -> None:
        """Counts ticks that were made without `is_due`, for `measure`."""
        self._window_ticks += ticks

    def wait(self) -> None:
        """Sleeps until the next tick is due, but at most `MAX_SLEEP_S`, so that the caller can check for requests."""
        if self._period_s:
            left_s = self._deadline_s - time.monotonic()
            if left_s > 0.0:
                time.sleep(min(left_s, MAX_SLEEP_S))

    def measure(self) -> float:
        """Returns the measured real-time factor since the last call of this method, or since the last restart."""
        now_s = time.monotonic()
        factor = self._window_ticks * self._dt_s / max(now_s - self._window_start_s, 1e-9)
        self._window_start_s, self._window_ticks = now_s, 0
        return factor


class Load(NamedTuple):
    """Times and number of ticks of the process: totals at one instant, or differences between two instants.

    Attributes:
        wall_s: Time by a monotonic wall clock [s].
        loop_s: Processor time [s] of the thread that runs the world.
        process_s: Processor time [s] of all threads of the process.
        physics_s: Wall time [s] spent in PyBullet's steps.
        ticks: Number of ticks made.
    """

    wall_s: float
    loop_s: float
    process_s: float
    physics_s: float
    ticks: int

    @classmethod
    def now(cls, physics_s: float, ticks: int) -> Load:
        """Returns the load until now; called in the thread that runs the world, whose processor time is measured.

        Args:
            physics_s: Wall time [s] spent in PyBullet's steps.
            ticks: Number of ticks made.
        """
        return cls(time.monotonic(), time.thread_time(), time.process_time(), physics_s, ticks)

    def since(self, before: Load) -> Load:
        """Returns the differences between this load and an earlier one, `before`."""
        wall_s, loop_s, process_s, physics_s = (now - then for now, then in zip(self[:4], before[:4]))
        return Load(wall_s, loop_s, process_s, physics_s, self.ticks - before.ticks)

    def reason(self, dt_s: float) -> str:
        """Returns a message with the likely reason why the world is too slow, and advice.

        Args:
            dt_s: Simulated time of a tick [s].
        """
        elsewhere = self.process_s - self.loop_s
        if self.loop_s < LEAST_SHARE * self.wall_s:
            got = f"the simulation got {100 * self.loop_s / self.wall_s:.0f} % of a processor"
            if elsewhere > (1.0 - LEAST_SHARE) * self.wall_s:
                others = f"other threads of the node {100 * elsewhere / self.wall_s:.0f} %"
                return f"{got}, {others}; send it fewer messages, call fewer services"
            return f"{got}, since the machine is busy; end other programs, or set a lower real_time_factor"
        tick_ms, physics_ms = (1e3 * spent_s / max(self.ticks, 1) for spent_s in (self.wall_s, self.physics_s))
        if physics_ms > tick_ms / 2:
            took = f"PyBullet takes {physics_ms:.2g} ms for a step of {1e3 * dt_s:.2g} ms"
            return f"{took}; use simpler collision shapes, fewer contacts or a larger timeStep"
        took = (
            f"sensors, controllers and messages take {tick_ms - physics_ms:.2g} ms a tick, PyBullet {physics_ms:.2g} ms"
        )
        return f"{took}; lower the rates of sensors and topics"
