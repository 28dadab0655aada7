"""A timer by the wall clock: it goes on when simulated time stands still or has not begun."""

from __future__ import annotations

import threading
import time
import traceback
from collections.abc import Callable

import rospy

from .throttle import ThrottledWarning


class WallTimer:
    """Calls something at a rate, in a thread of its own, until ROS shuts down; what it is late for it leaves out.

    An exception is logged, and the next call is made all the same.

    Args:
        hz: The rate [Hz].
        action: What to call.
    """

    def __init__(self, hz: float, action: Callable[[], None]) -> None:
        self._period_s = 1.0 / hz
        self._action = action
        self._warn = ThrottledWarning()
        self._ended = threading.Event()
        rospy.on_shutdown(self._ended.set)
        threading.Thread(target=self._run, name="wall timer", daemon=True).start()

    def _run(self) -> None:
        due_s = time.monotonic()
        while not self._ended.wait(max(due_s - time.monotonic(), 0.0)):
            try:
                self._action()
            except Exception:
                if not rospy.is_shutdown():  # else its topics are closed already
                    self._warn(threading.current_thread().name, traceback.format_exc())
            due_s = max(due_s + self._period_s, time.monotonic())
