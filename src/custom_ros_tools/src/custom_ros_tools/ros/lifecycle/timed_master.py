"""The ROS master, asked without waiting for ever."""

import http.client
from typing import Any
from xml.parsers.expat import ExpatError
from xmlrpc.client import Error, ServerProxy, Transport

import rosgraph

TIMEOUT_S = 2.0
"""How long the master may take to answer [s]; a healthy one takes milliseconds."""
MASTER_FAILURES = (OSError, Error, http.client.HTTPException, ExpatError)
"""What its calls raise if it has gone, hangs or is something else."""


class TimedTransport(Transport):
    """Waits for an answer for a limited time [s]: a process that is stopped accepts connections but never answers."""

    def __init__(self, timeout_s: float) -> None:
        super().__init__()
        self._timeout_s = timeout_s

    def make_connection(self, host: Any) -> http.client.HTTPConnection:
        """Returns the connection to a host; the base class calls it."""
        connection = super().make_connection(host)
        connection.timeout = self._timeout_s
        return connection


def timed_master(uri: str | None = None) -> Any:
    """Returns the XML-RPC interface of a master, by default of the environment's, a context that closes the connection.

    Its calls return (code, message, value) and raise one of MASTER_FAILURES if the master does not answer.
    """
    return ServerProxy(uri or rosgraph.get_master_uri(), TimedTransport(TIMEOUT_S))
