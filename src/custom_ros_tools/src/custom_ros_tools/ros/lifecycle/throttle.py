"""Warnings that do not flood, by the wall clock: rospy's own throttle stands still when simulated time does."""

import threading
import time

import rospy

_PERIOD_S = 5.0


class ThrottledWarning:
    """Warns about each subject at most once in some seconds of wall time, and counts what it kept back.

    Args:
        period_s: Shortest time between two warnings about one subject [s].
    """

    def __init__(self, period_s: float = _PERIOD_S) -> None:
        self._period_s = period_s
        self._lock = threading.Lock()
        self._last: dict[str, tuple[float, int]] = {}

    def __call__(self, subject: str, message: str) -> None:
        """Warns `SUBJECT: MESSAGE`, unless it did so a moment ago."""
        now_s = time.monotonic()
        with self._lock:
            last_s, kept_back = self._last.get(subject, (-self._period_s, 0))
            if now_s - last_s < self._period_s:
                self._last[subject] = (last_s, kept_back + 1)
                return
            self._last[subject] = (now_s, 0)
        more = f" ({kept_back} more like it since the last warning)" if kept_back else ""
        rospy.logwarn("%s: %s%s", subject, message, more)
