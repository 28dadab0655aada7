"""Simulated time in integers: ticks, stamps in nanoseconds, and schedules of periodic work."""

import time
from fractions import Fraction

NS_PER_S = 1_000_000_000
SLOWEST_HZ = Fraction(1, 1_000_000)


class Clock:
    """Counts ticks, and assigns a stamp to each tick.

    Each stamp is greater than all stamps before. Simulated stamps are exact: before a reset, tick `n` has the stamp
    `(n + 1) * dt`. The initial state has the stamp dt, since a stamp of 0 means "no time yet" in ROS. When the world is
    reset, ticks begin at 0 again, and stamps continue to increase.

    Args:
        time_step_s: Length of a tick [s], rounded to whole nanoseconds.
        simulated: Whether stamps are simulated time. If not, they are wall time (Unix epoch).

    Raises:
        ValueError: If the time step is shorter than a nanosecond.
    """

    def __init__(self, time_step_s: float, simulated: bool = True) -> None:
        self.dt_ns = round(time_step_s * NS_PER_S)
        if self.dt_ns < 1:
            raise ValueError(f"time step must be at least 1e-9 [s], got {time_step_s}")
        self.simulated = simulated
        self.tick = 0
        self.stamp_ns = self._on_time_ns = self.dt_ns if simulated else time.time_ns()

    @property
    def dt_s(self) -> float:
        """Length of a tick [s], equal to PyBullet's time step."""
        return self.dt_ns / NS_PER_S

    @property
    def time_s(self) -> float:
        """Simulated time [s] since the world was built or reset."""
        return self.tick * self.dt_ns / NS_PER_S

    def advance(self) -> None:
        """Advances to the next tick."""
        self.tick += 1
        if self.simulated:
            self._on_time_ns = on_time_ns = self._on_time_ns + self.dt_ns
            self.stamp_ns = on_time_ns if on_time_ns > self.stamp_ns else self.stamp_ns + 1  # max() costs more
        else:
            self.restamp()

    def skip(self, ticks: int) -> None:
        """Advances by several ticks at once, for a world that is set to a later state."""
        self.tick += ticks - 1
        self._on_time_ns += (ticks - 1) * self.dt_ns if self.simulated else 0
        self.advance()

    def restart(self) -> None:
        """Counts ticks from 0 again after a reset of the world; the stamp advances by a tick."""
        self.advance()
        self.tick = 0

    def restamp(self) -> None:
        """Renews a wall-time stamp within the same tick, so that a stopped world can publish its state again.

        Simulated stamps do not change.
        """
        if not self.simulated:
            self.stamp_ns = max(self.stamp_ns + 1, time.time_ns())

    def bump_stamp(self) -> None:
        """Increases the present stamp by 1 ns. The stamps of later ticks do not change."""
        self.stamp_ns += 1


class Schedule:
    """Decides at which ticks periodic work is due.

    Work is due at tick `n` if `floor(n * dt * hz)` is greater than at tick `n - 1`. The mean rate is exact, and the
    jitter is at most one tick. Integer arithmetic avoids drift.

    Args:
        hz: Rate of the work [Hz], clipped to SLOWEST_HZ ... `1 / dt`.
        dt_ns: Length of a tick [ns].

    Attributes:
        clamped: Whether `hz` was above `1 / dt`.
    """

    def __init__(self, hz: float, dt_ns: int) -> None:
        per_tick = max(Fraction(hz).limit_denominator(1_000_000), SLOWEST_HZ) * dt_ns / NS_PER_S
        self.clamped = per_tick > 1
        self._numerator, self._denominator = min(per_tick, Fraction(1)).as_integer_ratio()

    def is_due(self, tick: int, since: int | None = None) -> bool:
        """Returns whether work is due at a tick. At tick 0, work is always due.

        Args:
            tick: The tick.
            since: Previous tick that was checked, `tick - 1` if None. Checks all ticks after `since` up to `tick`.
        """
        return self._count(tick) > self._count(tick - 1 if since is None else since)

    def next_due(self, tick: int) -> int:
        """Returns the first tick after `tick` at which work is due."""
        return -(-(self._count(tick) + 1) * self._denominator // self._numerator)

    def _count(self, tick: int) -> int:
        return tick * self._numerator // self._denominator
