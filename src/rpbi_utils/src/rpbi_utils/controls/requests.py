"""Requests that run in the background, each with a time limit."""

import threading
import time
from collections.abc import Callable
from typing import Any, NamedTuple

from custom_ros_tools.errors import InterfaceError

LIMIT_S = 10.0
"""Time after which a request counts as unanswered [s]; its late answer is dropped."""


class RequestResult(NamedTuple):
    """The end of a request.

    Attributes:
        name: Name of the request, for people.
        value: What its function returned; None if it failed.
        error: Why it failed; empty if it did not.
        duration_s: Time that it took [s].
        then: Function that is called with the outcome, by the window.
    """

    name: str
    value: Any
    error: str
    duration_s: float
    then: Callable[["RequestResult"], None] | None


class BackgroundRequests:
    """Runs functions in threads of their own.

    Args:
        deliver: Receives each outcome exactly once, in any thread.
    """

    def __init__(self, deliver: Callable[[RequestResult], None]) -> None:
        self._deliver = deliver

    def ask(
        self,
        name: str,
        function: Callable[[], Any],
        then: Callable[[RequestResult], None] | None = None,
        limit_s: float = LIMIT_S,
    ) -> None:
        """Runs a function; returns at once. An exception of it is a failure."""
        threading.Thread(target=self._watch, args=(name, function, then, limit_s), name=name, daemon=True).start()

    def _watch(
        self, name: str, function: Callable[[], Any], then: Callable[[RequestResult], None] | None, limit_s: float
    ) -> None:
        start_s = time.monotonic()
        results: list[tuple[Any, str]] = []
        done = threading.Event()

        def work() -> None:
            try:
                results.append((function(), ""))
            except InterfaceError as error:
                results.append((None, str(error)))
            except Exception as error:  # of rospy, or of the answering node
                results.append((None, f"{type(error).__name__}: {error}"))
            done.set()

        threading.Thread(target=work, name=f"{name}, its work", daemon=True).start()
        done.wait(limit_s)
        value, error = results[0] if results else (None, f"no answer within {limit_s:g} s")
        self._deliver(RequestResult(name, value, error, time.monotonic() - start_s, then))
