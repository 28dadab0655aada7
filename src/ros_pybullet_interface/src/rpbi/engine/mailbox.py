"""Values and calls from other threads to the one thread that owns PyBullet."""

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
    """The simulation has ended and accepts no more requests."""


class Mailbox:
    """Latest-wins slots for streams, and a queue of calls with futures for requests.

    Any thread may `put` and `request`; only the simulation thread calls `drain` and `run_requests`. Threads share a
    single lock, which is held only to swap a reference.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._slots: dict[str, Any] = {}
        self._requests: deque[tuple[Callable[[], Any], Future[Any], bool]] = deque()
        self._closed = False
        self._busy: Callable[[], str] | None = None
        self.generation = 0
        """Incremented whenever all waiting values are dropped."""

    def put(
        self, slot: str, value: Any, merge: Callable[[Any, Any], Any] | None = None, generation: int | None = None
    ) -> None:
        """Puts a value into a slot; one that still waits is replaced, or merged with it.

        A value of another `generation` than the present one is dropped; so is any value while the world is busy.
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
        """Whether no value waits."""
        return not self._slots

    def drain(self) -> Mapping[str, Any]:
        """Empties all slots and returns their values by slot name."""
        if not self._slots:  # the usual case, which must be fast
            return NOTHING  # not the slots themselves: other threads may put something there while the caller reads
        with self._lock:
            taken, self._slots = self._slots, {}
        return taken

    def drop(self) -> None:
        """Empties all slots, and begins a new generation."""
        with self._lock:
            self._slots = {}
            self.generation += 1

    def hold(self, busy: Callable[[], str] | None) -> None:
        """Marks the world as busy: inputs are dropped and requests refused; None ends that.

        Args:
            busy: Returns the answer to requests meanwhile.
        """
        with self._lock:
            self._busy, self._slots = busy, {}

    def request(self, call: Callable[[], T], even_if_busy: bool = False) -> Future[T]:
        """Asks the simulation thread to make a call.

        Args:
            call: The call.
            even_if_busy: Whether it is made even while the world is busy, see `hold`.

        Returns:
            A future that gets the call's result, or the exception it raised.
        """
        future: Future[T] = Future()
        with self._lock:
            if not self._closed:
                self._requests.append((call, future, even_if_busy))
                return future
        future.set_exception(ClosedError("the simulation has ended"))
        return future

    def run_requests(self) -> None:
        """Makes the calls that wait now; those that come meanwhile wait for the next time."""
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
        """Refuses further requests and fails those that wait."""
        with self._lock:
            self._closed = True
            waiting, self._requests = self._requests, deque()
        for _, future, _ in waiting:
            if future.set_running_or_notify_cancel():
                future.set_exception(ClosedError("the simulation has ended"))
