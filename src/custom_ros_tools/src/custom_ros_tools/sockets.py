"""Sockets for rospy that a slow client cannot block: a connected socket that buffers, and a listening socket."""

from __future__ import annotations

import contextlib
import errno
import logging
import select
import socket
import struct
import threading
import time
from collections import deque
from typing import Any, NamedTuple

MAX_TOGETHER = 32
"""Number of buffered messages at which a socket flushes, and largest number of messages per system call."""
_at_once = threading.Event()
"""Set when the loop that flushes sockets has ended. From then on, every message is sent at once."""
log = logging.getLogger(__name__)
HEADER_TIMEOUT_S = 60.0
"""Time after which a new connection is closed if its header has not arrived [s]."""
MAX_HEADER_BYTES = 1 << 20
"""Largest length of a header [bytes]. Clients with other protocols are recognised because their first four bytes,
interpreted as a length, exceed this value."""
PEEKED = 1 << 15
"""Number of received bytes after which a longer header counts as complete, since the kernel's buffer is limited."""
OUT_OF_HANDLES_S = 0.5
"""Time that a node without free file handles waits before it accepts connections again [s]."""


class BufferedSocket:
    """A connected socket whose `sendall` never waits: `sendall` buffers messages, and `flush` sends them in order.

    Messages that the receiver does not accept yet stay in the buffer. The class is thread-safe. TCP_NODELAY is always
    set, not only if the subscriber requests it as with rospy. Without TCP_NODELAY, a message would wait up to 40 ms for
    the acknowledgement of the previous message.

    Args:
        connection: The connected socket.
        limit: Largest number of buffered messages. If more messages are buffered, the oldest messages are dropped.
    """

    def __init__(self, connection: socket.socket, limit: int) -> None:
        connection.setblocking(False)  # otherwise Python would wait for up to rospy's timeout
        if connection.family in (socket.AF_INET, socket.AF_INET6):
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket = connection
        self._lock = threading.Lock()
        self._begun = b""  # rest of partly sent data
        self._kept: deque[bytes] = deque(maxlen=limit)
        self._most_together = min(limit, MAX_TOGETHER)
        self._error: OSError | None = None
        """Error that closed the connection; None while the connection is open."""

    def __getattr__(self, name: str) -> Any:
        return getattr(self._socket, name)

    def sendall(self, data: bytes) -> None:
        """Buffers a message for the next flush, and flushes at once if many messages are buffered.

        Raises:
            OSError: If the connection failed in an earlier flush.
        """
        with self._lock:
            if self._error is not None:
                raise self._error
            self._kept.append(data)
            _unsent[self] = None
            if _at_once.is_set() or len(self._kept) >= self._most_together:
                self._send_kept()

    def flush(self) -> None:
        """Sends buffered messages as far as the receiver accepts them.

        If the connection has failed, the messages are dropped, and the next `sendall` raises the error.
        """
        with self._lock:
            self._send_kept()

    def _send_kept(self) -> None:
        while True:
            if not self._begun:
                if not self._kept:
                    _unsent.pop(self, None)
                    return
                count = min(len(self._kept), MAX_TOGETHER)
                self._begun = b"".join([self._kept.popleft() for _ in range(count)])
            try:
                self._begun = self._begun[self._socket.send(self._begun) :]
            except BlockingIOError:
                return
            except OSError as error:
                self._error, self._begun = error, b""
                self._kept.clear()


_unsent: dict[BufferedSocket, None] = {}
"""Sockets with buffered messages, sorted by the time of their first buffered message."""


def send_at_once() -> None:
    """Flushes all sockets, and makes them send every later message at once, for use after a node's loop has ended."""
    _at_once.set()
    flush_buffered_sockets()


def flush_buffered_sockets() -> None:
    """Flushes all sockets with buffered messages. A node's loop calls this function in each pass."""
    for each in tuple(_unsent):
        each.flush()


class _Pending(NamedTuple):
    """A connection whose header is incomplete.

    Attributes:
        connection: The socket.
        address: Address of the client.
        end_s: Time of the monotonic clock at which the connection is closed [s].
    """

    connection: socket.socket
    address: Any
    end_s: float


class ServerSocket:
    """A listening socket whose `accept` only returns connections whose TCPROS header has arrived.

    rospy reads the headers of all connections in one thread. So a client that does not send a header, for example a
    suspended program, would block all other clients of the node forever. With this class, several connections wait for
    their headers in parallel. If the node does not have a free file handle, `accept` waits and raises a TimeoutError,
    after which rospy calls `accept` again. Other errors would end rospy's thread.

    Args:
        server: The listening socket.
    """

    def __init__(self, server: socket.socket) -> None:
        self._server, self._server_file = server, server.fileno()
        self._pending: dict[int, _Pending] = {}
        self._ready: deque[_Pending] = deque()
        self._poll = select.epoll()
        self._poll.register(self._server_file, select.EPOLLIN)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._server, name)

    def accept(self) -> tuple[socket.socket, Any]:
        """Waits for the next connection whose header has arrived, and returns the connection and its address."""
        while not self._ready:
            now_s = time.monotonic()
            for pending in [each for each in self._pending.values() if each.end_s <= now_s]:
                self._refuse(pending, f"no header came within {HEADER_TIMEOUT_S:g} s")
            next_s = min((each.end_s for each in self._pending.values()), default=None)
            files = {file for file, _ in self._poll.poll(None if next_s is None else next_s - now_s)}
            for pending in [self._pending[file] for file in files - {self._server_file}]:
                self._look_at(pending)
            if self._server_file in files:
                self._accept_one()
        pending = self._ready.popleft()
        return pending.connection, pending.address

    def _accept_one(self) -> None:
        try:
            connection, address = self._server.accept()
        except OSError as error:
            if error.errno not in (errno.EMFILE, errno.ENFILE):
                raise
            time.sleep(OUT_OF_HANDLES_S)
            raise TimeoutError from None
        self._pending[connection.fileno()] = _Pending(connection, address, time.monotonic() + HEADER_TIMEOUT_S)
        # edge-triggered, since the data are not read here
        self._poll.register(connection.fileno(), select.EPOLLIN | select.EPOLLRDHUP | select.EPOLLET)

    def _look_at(self, pending: _Pending) -> None:
        """Marks a connection as ready if its header has arrived, or closes it if a header cannot arrive any more."""
        try:
            peeked = pending.connection.recv(PEEKED, socket.MSG_PEEK | socket.MSG_DONTWAIT)
        except BlockingIOError:
            return
        except OSError:
            peeked = b""
        if not peeked:  # the client has closed the connection
            self._forget(pending)
            pending.connection.close()
        elif len(peeked) >= 4:
            size = struct.unpack("<I", peeked[:4])[0]
            if not 0 < size <= MAX_HEADER_BYTES:
                self._refuse(pending, f"it does not speak TCPROS: {peeked[:20]!r}")
            elif len(peeked) >= min(4 + size, PEEKED):
                self._forget(pending)
                self._ready.append(pending)

    def _refuse(self, pending: _Pending, why: str) -> None:
        self._forget(pending)
        pending.connection.close()
        log.warning("connection from %s closed: %s", pending.address, why)

    def _forget(self, pending: _Pending) -> None:
        file = pending.connection.fileno()
        del self._pending[file]
        with contextlib.suppress(OSError):
            self._poll.unregister(file)
