"""The ROS master, asked without waiting for ever, and where there is room for another one."""

import http.client
import random
import socket
from typing import Any
from xml.parsers.expat import ExpatError
from xmlrpc.client import Error, ServerProxy, Transport

import rosgraph

TIMEOUT_S = 2.0
"""How long the master may take to answer [s]; a healthy one takes milliseconds."""
MASTER_FAILURES = (OSError, Error, http.client.HTTPException, ExpatError)
"""What its calls raise if it has gone, hangs or is something else."""

PORTS = range(22000, 32000)
"""Ports for masters, below those that the kernel gives to whoever asks for any."""


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


def unused_port() -> int:
    """Returns a port for a master of one's own.

    It is one that the kernel gives to nobody, so that none of the many nodes around has it before the master does.

    Raises:
        OSError: If there is none.
    """
    for port in random.sample(PORTS, len(PORTS)):
        with socket.socket() as probe:
            try:
                probe.bind(("", port))
            except OSError:
                continue
            return port
    raise OSError(f"no port from {PORTS.start} to {PORTS.stop - 1} is free")
