"""Passes values and calls from other threads to the simulation thread, which owns PyBullet."""

import threading
from collections import deque
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from types import MappingProxyType
from typing import Any, TypeVar

from custom_ros_tools.errors import InterfaceError

T = TypeVar("T")
NOTHING: Mapping[str, Any] = MappingProxyType({})


class ClosedError(RuntimeError):
    """A request was refused because the simulation has ended."""


class Mailbox:
    """Holds the newest value of each input stream, and a queue of requested calls.

    Each stream has a slot. Any thread may call `put` and `request`; only the simulation thread calls `drain` and
    `run_requests`. A lock protects the slots and the queue, and is held only briefly.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._slots: dict[str, Any] = {}
        self._requests: deque[tuple[Callable[[], Any], Future[Any], bool]] = deque()
        self._closed = False
        self._busy: Callable[[], str] | None = None
        self.generation = 0
        """Number of calls of `drop`."""

    def put(
        self, slot: str, value: Any, merge: Callable[[Any, Any], Any] | None = None, generation: int | None = None
    ) -> None:
        """Stores a value in a slot, for the next `drain`.

        Ignores the value while the world is busy, see `hold`.

        Args:
            slot: Name of the slot.
            value: The value.
            merge: Function that combines the value that waits in the slot with the new value. If None, the new value
                replaces the waiting one.
            generation: The mailbox's `generation` when the value was checked. If `drop` was called since then, the
                value is ignored. None stores the value regardless of `drop`.
        """
        with self._lock:
            if self._busy is not None or generation not in (None, self.generation):
                return
            if merge is not None and slot in self._slots:
                value = merge(self._slots[slot], value)
            self._slots[slot] = value

    @property
    def is_held(self) -> bool:
        """Whether the world is busy, see `hold`."""
        return self._busy is not None

    @property
    def is_empty(self) -> bool:
        """Whether all slots are empty."""
        return not self._slots

    def drain(self) -> Mapping[str, Any]:
        """Empties all slots, and returns their values, keyed by slot name."""
        if not self._slots:  # the usual case, which must be fast
            return NOTHING  # not self._slots, since other threads may add values while the caller reads
        with self._lock:
            taken, self._slots = self._slots, {}
        return taken

    def drop(self) -> None:
        """Empties all slots, and increments `generation`."""
        with self._lock:
            self._slots = {}
            self.generation += 1

    def hold(self, busy: Callable[[], str] | None) -> None:
        """Marks the world as busy, or as no longer busy. A busy world ignores new values and refuses requests.

        Args:
            busy: Function that returns the error message for refused requests; None if the world is no longer busy.
        """
        with self._lock:
            self._busy, self._slots = busy, {}

    def request(self, call: Callable[[], T], even_if_busy: bool = False) -> Future[T]:
        """Queues a call for the simulation thread, and returns a future of the call's result.

        Args:
            call: Function without arguments.
            even_if_busy: Whether to make the call even while the world is busy, see `hold`.

        Returns:
            Future of the result, or of the exception that the call raised. After `close` the exception is ClosedError.
        """
        future: Future[T] = Future()
        with self._lock:
            if not self._closed:
                self._requests.append((call, future, even_if_busy))
                return future
        future.set_exception(ClosedError("the simulation has ended"))
        return future

    def run_requests(self) -> None:
        """Makes the queued calls, and sets their futures. Calls queued during this run wait for the next run."""
        for _ in range(len(self._requests)):
            call, future, even_if_busy = self._requests.popleft()
            if not future.set_running_or_notify_cancel():
                continue  # the caller has given up waiting
            try:
                if self._busy is not None and not even_if_busy:
                    raise InterfaceError(self._busy())
                future.set_result(call())
            except Exception as error:
                future.set_exception(error)

    def close(self) -> None:
        """Refuses further requests, and fails all waiting requests with ClosedError."""
        with self._lock:
            self._closed = True
            waiting, self._requests = self._requests, deque()
        for _, future, _ in waiting:
            if future.set_running_or_notify_cancel():
                future.set_exception(ClosedError("the simulation has ended"))
