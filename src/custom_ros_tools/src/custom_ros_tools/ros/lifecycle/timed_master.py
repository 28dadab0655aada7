"""Calls the ROS master with a time limit, checks this node's address, and finds ports for private masters."""

import http.client
import os
import random
import socket
from collections.abc import Callable
from typing import Any
from xml.parsers.expat import ExpatError
from xmlrpc.client import MAXINT, MININT, Error, Marshaller, ServerProxy, Transport

import rosgraph

TIMEOUT_S = 2.0
"""Longest time to wait for an answer of the master [s]; usually, an answer takes milliseconds."""
MASTER_FAILURES = (OSError, Error, http.client.HTTPException, ExpatError)
"""Exceptions of calls to the master if the master has ended or hangs, or if another program uses the master's port."""

PORTS = range(22000, 32000)
"""Ports for private masters, outside the range that the kernel assigns automatically."""


class TimedTransport(Transport):
    """XML-RPC transport with a timeout [s].

    A suspended process (SIGSTOP) still accepts connections but never answers, so a call could wait forever.
    """

    def __init__(self, timeout_s: float) -> None:
        super().__init__()
        self._timeout_s = timeout_s

    def make_connection(self, host: Any) -> http.client.HTTPConnection:
        """Makes a connection that has the timeout; called by the base class."""
        connection = super().make_connection(host)
        connection.timeout = self._timeout_s
        return connection


def timed_master(uri: str | None = None) -> Any:
    """Returns the XML-RPC interface of a ROS master or a `roslaunch`, as a context manager that closes the connection.

    Calls return (code, message, value). They raise one of `MASTER_FAILURES` if the master does not answer in time.

    Args:
        uri: Its address; by default ROS_MASTER_URI.
    """
    return ServerProxy(uri or rosgraph.get_master_uri(), TimedTransport(TIMEOUT_S))


def allow_large_integers() -> None:
    """Makes Python's XML-RPC send integers with more than 32 bits as type `i8`, instead of raising an error.

    rospy counts sent bytes. Without this change, a node that has sent more than 2 GB could not answer `getBusStats`,
    from which recorders read the number of sent messages.
    """

    def dump(_: Marshaller, value: int, write: Callable[[str], object]) -> None:
        kind = "int" if MININT <= value <= MAXINT else "i8"
        write(f"<value><{kind}>{value:d}</{kind}></value>\n")

    dispatch: Any = Marshaller.dispatch
    dispatch[int] = dump


def address_fault() -> str | None:
    """Checks the address under which other nodes reach this node. Returns a warning in one line, or None.

    The address comes from ROS_HOSTNAME, ROS_IP or this computer's name. Three conditions are checked. The address must
    belong to this computer. If the master is reached through a network, the address must not be a loopback address. If
    the master is on another computer, the address should be that from which this computer reaches the master.
    """
    variable = next((name for name in ("ROS_HOSTNAME", "ROS_IP") if os.environ.get(name)), None)
    given = rosgraph.network.get_host_name()
    what = f"{variable} is {given}" if variable else f"the name of this computer, the nodes' address, is {given}"
    uri = rosgraph.get_master_uri()
    try:
        master = socket.gethostbyname(rosgraph.network.parse_http_host_and_port(uri)[0])
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.connect((master, 1))  # sends nothing
            ours = str(probe.getsockname()[0])
    except (OSError, ValueError):
        return None
    remedy = f"export ROS_IP={ours} in this terminal"
    try:
        address = socket.gethostbyname(given)
    except OSError:
        return f"{what}, which is no address and does not resolve: other nodes cannot reach this one; {remedy}"
    if not _is_of_this_computer(address):
        return f"{what}, which is no address of this computer: other nodes cannot reach this one; {remedy}"
    if address.startswith("127.") and not ours.startswith("127."):
        where = f"({address}) " if address != given else ""
        return f"{what}, {where}which only this computer reaches, but the ROS master is at {uri}; {remedy}"
    if address != ours and not _is_of_this_computer(master):
        by = f"this computer reaches the ROS master at {uri} from {ours}"
        return f"{what}, but {by}: nodes there may not reach this one; if so, {remedy}"
    return None


def _is_of_this_computer(address: str) -> bool:
    with socket.socket() as probe:
        try:
            probe.bind((address, 0))
        except OSError:
            return False
        return True


def unused_port() -> int:
    """Returns a free port for a private master, chosen at random from `PORTS`.

    The kernel does not assign `PORTS` automatically, so that a node cannot get the port before the master uses it.

    Raises:
        OSError: If all ports are in use.
    """
    for port in random.sample(PORTS, len(PORTS)):
        with socket.socket() as probe:
            try:
                probe.bind(("", port))
            except OSError:
                continue
            return port
    raise OSError(f"no port from {PORTS.start} to {PORTS.stop - 1} is free")
