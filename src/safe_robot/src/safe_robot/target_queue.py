"""Queue that passes targets to the guard one period apart, and only while new targets arrive."""

import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Generic, TypeVar

Item = TypeVar("Item")
PATIENCE_S = 0.1
"""Longest time that targets wait for a newer target [s]."""
WAKE_UP_S = 0.0002
"""Time by which the queue's thread wakes up before a target is due [s]."""


class TargetQueue(Generic[Item]):
    """Passes targets on, at least a period apart, while the newest target is recent.

    A target that arrives a period or more after the previous target is passed on at once, in the thread that calls
    `put`. A target that arrives sooner waits, so that a burst does not make the robot faster. Waiting targets are
    passed on only while the newest target is recent, so that the robot stops when the source of targets has ended.

    Args:
        period_s: Shortest time between two targets that are passed on [s].
        silence_s: Largest age at which the newest target counts as recent [s]. When the newest target is older,
            waiting targets are dropped after `PATIENCE_S`.
        size: Largest number of waiting targets; if there are more, the oldest are dropped.
        on_target: Called with each target while `lock` is held. Returns whether the next target has to wait a period.
        give_up: Called with the newest target's age [s] when waiting targets are dropped, while `lock` is held.

    Attributes:
        lock: Held while a target is passed on.
    """

    def __init__(
        self,
        period_s: float,
        silence_s: float,
        size: int,
        on_target: Callable[[Item], bool],
        give_up: Callable[[float], None],
    ) -> None:
        self._period_s, self._silence_s = period_s, silence_s
        self._on_target, self._give_up = on_target, give_up
        self.lock = threading.Condition()
        self._waiting: deque[tuple[Item, float]] = deque(maxlen=size)
        self._step: Callable[[], bool] | None = None
        self._due_s = self._alive_s = float("-inf")
        threading.Thread(target=self._run, name="target queue", daemon=True).start()

    def put(self, item: Item, age_s: float) -> None:
        """Passes a target on at once if the period since the previous target is over; otherwise, queues the target.

        Args:
            item: The target.
            age_s: Age of the target [s]; 0 if unknown.
        """
        with self.lock:
            now_s = time.monotonic()
            self._alive_s = max(self._alive_s, now_s - max(age_s, 0.0))
            self._waiting.append((item, now_s))
            if self._left_s(now_s) <= 0.0 and self._is_alive(now_s):
                self._pass_on()
            if self._waiting:
                self.lock.notify()

    def clear(self) -> None:
        """Drops all waiting targets; the caller holds `lock`."""
        self._waiting.clear()

    def run_instead(self, step: Callable[[], bool]) -> None:
        """Drops all waiting targets, and calls `step` once per period from now on; the caller holds `lock`.

        The first call is a period after the last target. Calls are at least a period apart, even after a late call.

        Args:
            step: Called while `lock` is held, until it returns False.
        """
        self._waiting.clear()
        self._step = step
        self.lock.notify()

    def _left_s(self, now_s: float) -> float:
        return self._due_s - now_s

    def _is_alive(self, now_s: float) -> bool:
        return now_s - self._alive_s <= self._silence_s

    def _pass_on(self) -> None:
        item, _ = self._waiting.popleft()
        begin_s = time.monotonic()  # before the decision, whose duration would lengthen each period
        if self._on_target(item):
            self._due_s = max(self._due_s, begin_s) + self._period_s

    def _run(self) -> None:
        with self.lock:
            while True:
                self.lock.wait(self._rest_s())

    def _rest_s(self) -> float | None:
        """Passes on all due targets, or runs all due steps.

        Returns:
            Time until the next target or step is due [s]; None if nothing waits.
        """
        while self._step or self._waiting:
            now_s = time.monotonic()
            if (left_s := self._left_s(now_s)) > WAKE_UP_S:
                return left_s - WAKE_UP_S
            if left_s > 0.0:
                continue
            if self._step:
                if self._step():
                    self._due_s = time.monotonic() + self._period_s
                else:
                    self._step = None
                continue
            if self._is_alive(now_s):
                self._pass_on()
                continue
            if (left_s := self._waiting[0][1] + PATIENCE_S - now_s) > 0.0:
                return left_s
            self._waiting.clear()
            self._give_up(now_s - self._alive_s)
        return None
