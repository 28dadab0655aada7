"""Targets on their way to the guard: one by one, and only while their source is alive."""

import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Generic, TypeVar

Item = TypeVar("Item")
PATIENCE_S = 0.1
"""How long targets wait for a sign of life of their source [s]."""
WAKE_UP_S = 0.0002
"""So long before a target is due the queue's thread is woken up, since that takes time [s]."""


class TargetQueue(Generic[Item]):
    """Hands targets on, a period apart, as long as the newest one is fresh.

    A target that comes when the period is over is handed on at once, by the thread that brings it. What comes sooner
    waits, so that a burst makes no robot faster. What waits is handed on only while the newest target that has come is
    younger than a limit: a source that died leaves nothing behind that would go on moving a robot.

    Args:
        period_s: The period [s].
        silence_s: How old the newest target may be [s].
        size: How many targets wait at most; older ones are dropped.
        take: Gets each target, `lock` held; returns whether the period begins anew.
        give_up: Is called, `lock` held, with the age of the newest target [s], when targets have waited in vain;
            they are dropped.

    Attributes:
        lock: Held while a target is taken.
    """

    def __init__(
        self,
        period_s: float,
        silence_s: float,
        size: int,
        take: Callable[[Item], bool],
        give_up: Callable[[float], None],
    ) -> None:
        self._period_s, self._silence_s = period_s, silence_s
        self._take, self._give_up = take, give_up
        self.lock = threading.Condition()
        self._waiting: deque[tuple[Item, float]] = deque(maxlen=size)
        self._step: Callable[[], bool] | None = None
        self._due_s = self._alive_s = float("-inf")
        threading.Thread(target=self._run, name="target queue", daemon=True).start()

    def put(self, item: Item, age_s: float) -> None:
        """Hands a target on, now or later.

        Args:
            item: The target.
            age_s: How old it is [s]; 0 if nobody knows.
        """
        with self.lock:
            now_s = time.monotonic()
            self._alive_s = max(self._alive_s, now_s - max(age_s, 0.0))
            self._waiting.append((item, now_s))
            if self._left_s(now_s) <= 0.0 and self._is_alive(now_s):
                self._hand_on()
            if self._waiting:
                self.lock.notify()

    def clear(self) -> None:
        """Drops all that waits; `lock` is held."""
        self._waiting.clear()

    def run_instead(self, step: Callable[[], bool]) -> None:
        """Drops all that waits, and calls a step a period after what was handed on last, and so on; `lock` is held.

        What is late is not caught up with: no call follows another one sooner than a period.

        Args:
            step: Is called, `lock` held, until it returns False.
        """
        self._waiting.clear()
        self._step = step
        self.lock.notify()

    def _left_s(self, now_s: float) -> float:
        return self._due_s - now_s

    def _is_alive(self, now_s: float) -> bool:
        return now_s - self._alive_s <= self._silence_s

    def _hand_on(self) -> None:
        item, _ = self._waiting.popleft()
        begin_s = time.monotonic()  # else each period would be longer by what a decision takes
        if self._take(item):
            self._due_s = max(self._due_s, begin_s) + self._period_s

    def _run(self) -> None:
        with self.lock:
            while True:
                self.lock.wait(self._rest_s())

    def _rest_s(self) -> float | None:
        """Hands on what is due; returns how long there is nothing to do then [s], None: until a target comes."""
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
                self._hand_on()
                continue
            if (left_s := self._waiting[0][1] + PATIENCE_S - now_s) > 0.0:
                return left_s
            self._waiting.clear()
            self._give_up(now_s - self._alive_s)
        return None
