"""XML-RPC that does not wait for ever."""

from __future__ import annotations

import http.client
from typing import Any
from xmlrpc.client import Transport


class TimedTransport(Transport):
    """Waits for an answer for a limited time: a process that is stopped accepts connections but never answers.

    Args:
        timeout_s: How long [s].
    """

    def __init__(self, timeout_s: float) -> None:
        super().__init__()
        self._timeout_s = timeout_s

    def make_connection(self, host: Any) -> http.client.HTTPConnection:
        """Returns the connection to a host; the base class calls it."""
        connection = super().make_connection(host)
        connection.timeout = self._timeout_s
        return connection
