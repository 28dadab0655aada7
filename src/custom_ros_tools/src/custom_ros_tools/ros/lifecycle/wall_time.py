"""Timers, rates and throttled warnings by the wall clock, which also run while simulated time is stopped."""

import re
import threading
import time
import traceback
from collections.abc import Callable

import rospy

MAX_KINDS = 20
"""Default number of kinds of warnings that are distinguished for each subject."""
_NUMBER = re.compile(r"-?\d[\d.]*(e[-+]?\d+)?")


class WallRate:
    """Schedules events at a rate; missed ones are skipped.

    Args:
        hz: The rate [Hz]; 0 is never.
        delay_s: Time until it is due for the first time [s].
    """

    def __init__(self, hz: float, delay_s: float = 0.0) -> None:
        self._period_s = 1.0 / hz if hz else float("inf")
        self._due_s = time.monotonic() + delay_s if hz else float("inf")

    @property
    def left_s(self) -> float:
        """Time until it is due again [s]; 0 or less if it is due."""
        return self._due_s - time.monotonic()

    def is_due(self) -> bool:
        """Returns whether it is due; if so, it is due again a period later."""
        now_s = time.monotonic()
        if now_s < self._due_s:
            return False
        self._due_s = max(self._due_s + self._period_s, now_s)
        return True

    def rest(self, duration_s: float) -> None:
        """Postpones the next event by some time from now [s]."""
        self._due_s = max(self._due_s, time.monotonic() + duration_s)


class WallTimer:
    """Calls a function at a rate [Hz], in a thread of its own, until it is stopped or ROS shuts down.

    An exception is logged, and does not prevent the next call.
    """

    def __init__(self, hz: float, action: Callable[[], None]) -> None:
        self._rate, self._action = WallRate(hz), action
        self._warn = ThrottledWarning()
        self._ended = threading.Event()
        rospy.on_shutdown(self.stop)
        threading.Thread(target=self._run, name="wall timer", daemon=True).start()

    def stop(self) -> None:
        """Prevents further calls; a running one completes."""
        self._ended.set()

    def _run(self) -> None:
        while not self._ended.wait(max(self._rate.left_s, 0.0)):
            try:
                if self._rate.is_due():
                    self._action()
            except Exception:
                if not self._ended.is_set():  # otherwise its topics may be closed already
                    self._warn(threading.current_thread().name, traceback.format_exc())


class ThrottledWarning:
    """Warns at once of each new kind of fault of a subject, and of known kinds at most once in a period of wall time
    [s].

    It counts the warnings that it suppresses. Messages are of one kind if they differ in numbers alone.

    Args:
        period_s: The period.
        max_kinds: Number of kinds of a subject beyond which none counts as new.
    """

    def __init__(self, period_s: float = 5.0, max_kinds: int = MAX_KINDS) -> None:
        self._period_s, self._max_kinds = period_s, max_kinds
        self._lock = threading.Lock()
        self._last: dict[str, tuple[float, int]] = {}
        self._kinds: dict[str, set[str]] = {}

    def __call__(self, subject: str, message: str) -> None:
        """Warns `SUBJECT: MESSAGE`, unless it did so within the period."""
        now_s, kind = time.monotonic(), _NUMBER.sub("#", message)
        with self._lock:
            kinds = self._kinds.setdefault(subject, set())
            is_new = kind not in kinds and len(kinds) < self._max_kinds
            last_s, kept_back = self._last.get(subject, (-self._period_s, 0))
            if not is_new and now_s - last_s < self._period_s:
                self._last[subject] = (last_s, kept_back + 1)
                return
            self._last[subject] = (now_s, 0)
            if is_new:
                kinds.add(kind)
        more = f" ({kept_back} more like it since the last warning)" if kept_back else ""
        rospy.logwarn("%s: %s%s", subject, message, more)
