"""Keeps ticks in step with the wall clock."""

import time

MAX_DEBT_S = 0.25
"""How late a tick may be and still be caught up with; of one that is later, all the lateness is given up [s]."""

MAX_SLEEP_S = 0.005
"""Longest sleep between two looks at requests, however slow the motion [s]."""


class Pacer:
    """Tells when the next tick is due by the wall clock, and counts what came late.

    Deadlines are absolute, so lateness does not add up: after a late tick the next ones follow at once until the debt
    is paid; one beyond MAX_DEBT_S is given up whole.

    Args:
        dt_s: Length of a tick [s] of simulated time.
        real_time_factor: Simulated seconds per wall second; 0 is as fast as it goes.

    Attributes:
        real_time_factor: The same, as it was set last.
    """

    def __init__(self, dt_s: float, real_time_factor: float = 1.0) -> None:
        self._dt_s = dt_s
        self.overruns = 0
        """Ticks that began more than one period late."""
        self.lost_s = 0.0
        """Wall time that was given up because it could not be caught up with [s]."""
        self.set_factor(real_time_factor)

    def set_factor(self, real_time_factor: float) -> None:
        """Changes the pace, and begins afresh."""
        self.real_time_factor = real_time_factor
        self._period_s = self._dt_s / real_time_factor if real_time_factor else 0.0
        self.restart()

    def restart(self) -> None:
        """Begins afresh, with a tick due now; for a start after a stop."""
        self._deadline_s = time.monotonic()
        self._window_start_s = self._deadline_s
        self._window_ticks = 0

    def is_due(self) -> bool:
        """Tells whether the next tick is due, and if so takes it as begun."""
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

    def wait(self) -> None:
        """Sleeps until the next tick is due, or until it is time to look at requests."""
        if self._period_s:
            left_s = self._deadline_s - time.monotonic()
            if left_s > 0.0:
                time.sleep(min(left_s, MAX_SLEEP_S))

    def measure(self) -> float:
        """Returns the real-time factor since the last call or restart."""
        now_s = time.monotonic()
        factor = self._window_ticks * self._dt_s / max(now_s - self._window_start_s, 1e-9)
        self._window_start_s, self._window_ticks = now_s, 0
        return factor
