"""Runs requests in the background, each with a time limit."""

import threading
import time
from collections.abc import Callable
from typing import Any, NamedTuple

from custom_ros_tools.errors import InterfaceError

LIMIT_S = 10.0
"""Time after which a request counts as unanswered [s]. A later answer is dropped."""


class RequestResult(NamedTuple):
    """Result of a request that has succeeded, failed or timed out.

    Attributes:
        name: Name of the request, as shown to the user.
        value: Return value of the request's function; None after a failure.
        error: Reason for the failure; empty on success.
        duration_s: Duration of the request [s].
        then: Function that the window calls with this result; None for no call.
    """

    name: str
    value: Any
    error: str
    duration_s: float
    then: Callable[["RequestResult"], None] | None


class BackgroundRequests:
    """Runs each requested function in its own thread.

    Args:
        deliver: Function that is called exactly once with each request's result, from a background thread.
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
        """Starts a function in the background and returns at once.

        The result contains an error if the function raises an exception or takes longer than `limit_s` [s].
        """
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
            except Exception as error:  # raised by rospy or by the node that answers
                results.append((None, f"{type(error).__name__}: {error}"))
            done.set()

        threading.Thread(target=work, name=f"{name}, its work", daemon=True).start()
        done.wait(limit_s)
        value, error = results[0] if results else (None, f"no answer within {limit_s:g} s")
        self._deliver(RequestResult(name, value, error, time.monotonic() - start_s, then))
