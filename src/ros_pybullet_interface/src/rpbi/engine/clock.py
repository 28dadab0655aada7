"""Integer simulated time: ticks, nanoseconds, and when a rate is due."""

import time
from fractions import Fraction

NS_PER_S = 1_000_000_000
SLOWEST_HZ = Fraction(1, 1_000_000)


class Clock:
    """Counts ticks and gives each its stamp.

    Stamps never repeat and never decrease while the clock exists. Simulated stamps are exact: tick `n` is stamped `(n +
    1) * dt`, so the initial state has the stamp dt, since a stamp of 0 means "no time yet" in ROS. Ticks are the
    world's: they begin at 0 again when it is reset, while the stamps go on.

    Args:
        time_step_s: Length of a tick [s], rounded to whole nanoseconds.
        simulated: Whether stamps are simulated time; otherwise they are wall time (Unix epoch).

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
        """Length of a tick [s], exactly what PyBullet steps by."""
        return self.dt_ns / NS_PER_S

    @property
    def time_s(self) -> float:
        """Simulated time since the world was built or reset [s]."""
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
        """Advances by ticks at once, for a world that is put into a later state."""
        self.tick += ticks - 1
        self._on_time_ns += (ticks - 1) * self.dt_ns if self.simulated else 0
        self.advance()

    def restart(self) -> None:
        """Counts ticks from 0 again, for a world that was reset; stamps go on."""
        self.advance()
        self.tick = 0

    def restamp(self) -> None:
        """Renews a wall-time stamp within the same tick, for state that is sent again while stopped."""
        if not self.simulated:
            self.stamp_ns = max(self.stamp_ns + 1, time.time_ns())

    def bump_stamp(self) -> None:
        """Makes the next stamp differ from the last one; the stamps of coming ticks do not change."""
        self.stamp_ns += 1


class Schedule:
    """The ticks at which something of a given rate is due.

    It is due at tick `n` when `floor(n * dt * hz)` is greater than at tick `n - 1`: the mean rate is exact and the
    jitter at most one tick. All in integers, so nothing drifts.

    Args:
        hz: Rate [Hz]; at least SLOWEST_HZ and at most `1 / dt` (see `clamped`).
        dt_ns: Length of a tick [ns].
    """

    def __init__(self, hz: float, dt_ns: int) -> None:
        per_tick = max(Fraction(hz).limit_denominator(1_000_000), SLOWEST_HZ) * dt_ns / NS_PER_S
        self.clamped = per_tick > 1
        self._numerator, self._denominator = min(per_tick, Fraction(1)).as_integer_ratio()

    def is_due(self, tick: int, since: int | None = None) -> bool:
        """Returns whether it is due at `tick`, or was at any tick after `since`; at tick 0 it always is."""
        return self._count(tick) > self._count(tick - 1 if since is None else since)

    def next_due(self, tick: int) -> int:
        """Returns the first tick after `tick` at which it is due."""
        return -(-(self._count(tick) + 1) * self._denominator // self._numerator)

    def _count(self, tick: int) -> int:
        return tick * self._numerator // self._denominator
