"""Timers, rates and throttled warnings that use wall time, so that they also work while simulated time is stopped."""

import re
import threading
import time
import traceback
from collections.abc import Callable

import rospy

MAX_KINDS = 20
"""Default of `max_kinds` in `ThrottledWarning`."""
_NUMBER = re.compile(r"-?\d[\d.]*(e[-+]?\d+)?")


class WallRate:
    """Schedules events at a fixed rate in wall time; missed events are skipped.

    Args:
        hz: Rate of the events [Hz]; 0 for no events.
        delay_s: Time until the first event [s].
    """

    def __init__(self, hz: float, delay_s: float = 0.0) -> None:
        self._period_s = 1.0 / hz if hz else float("inf")
        self._due_s = time.monotonic() + delay_s if hz else float("inf")

    @property
    def left_s(self) -> float:
        """Time until the next event [s]; 0 or less if the event is due."""
        return self._due_s - time.monotonic()

    def is_due(self) -> bool:
        """Returns whether an event is due. If an event is due, schedules the next event."""
        now_s = time.monotonic()
        if now_s < self._due_s:
            return False
        self._due_s = max(self._due_s + self._period_s, now_s)
        return True

    def rest(self, duration_s: float) -> None:
        """Postpones the next event, so that it is due after `duration_s` from now at the earliest [s]."""
        self._due_s = max(self._due_s, time.monotonic() + duration_s)


class WallTimer:
    """Calls a function at a fixed rate in wall time, in a separate thread, until `stop` is called or ROS shuts down.

    Exceptions of the function are logged, and do not stop the timer.

    Args:
        hz: The rate [Hz].
        action: Function without arguments that is called.
    """

    def __init__(self, hz: float, action: Callable[[], None]) -> None:
        self._rate, self._action = WallRate(hz), action
        self._warn = ThrottledWarning()
        self._ended = threading.Event()
        rospy.on_shutdown(self.stop)
        threading.Thread(target=self._run, name="wall timer", daemon=True).start()

    def stop(self) -> None:
        """Prevents further calls of the function. A call that has begun is completed."""
        self._ended.set()

    def _run(self) -> None:
        while not self._ended.wait(max(self._rate.left_s, 0.0)):
            try:
                if self._rate.is_due():
                    self._action()
            except Exception:
                if not self._ended.is_set():  # afterwards, errors about closed topics are expected
                    self._warn(threading.current_thread().name, traceback.format_exc())


class ThrottledWarning:
    """Logs warnings about subjects, such as topics, and suppresses frequent repetitions.

    The first message of each kind about a subject is logged at once. Later messages about the subject are logged at
    most once per period; suppressed messages are counted. Messages that only differ in numbers are of the same kind.

    Args:
        period_s: The period, in wall time [s].
        max_kinds: Largest number of kinds per subject. First messages of further kinds are not logged at once.
    """

    def __init__(self, period_s: float = 5.0, max_kinds: int = MAX_KINDS) -> None:
        self._period_s, self._max_kinds = period_s, max_kinds
        self._lock = threading.Lock()
        self._last: dict[str, tuple[float, int]] = {}
        self._kinds: dict[str, set[str]] = {}

    def __call__(self, subject: str, message: str) -> None:
        """Logs the warning `SUBJECT: MESSAGE`, or suppresses and counts it."""
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
