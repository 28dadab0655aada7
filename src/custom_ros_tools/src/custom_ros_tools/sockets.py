"""Sockets that no client can block: connections that send without waiting, and a listening socket."""

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
"""Largest number of messages that are buffered until the next flush and sent by one system call."""
_at_once = threading.Event()
"""Set when no thread flushes any longer."""
log = logging.getLogger(__name__)
HEADER_TIMEOUT_S = 60.0
"""Time within which a connection has to send its header [s]; then it is closed."""
MAX_HEADER_BYTES = 1 << 20
"""Largest length of a header [bytes]; the first four bytes of other protocols, read as a length, exceed it."""
PEEKED = 1 << 15
"""Number of bytes after which a longer header counts as arrived, since the kernel's buffer is limited."""
OUT_OF_HANDLES_S = 0.5
"""Time for which a node without free file handles waits before it accepts again [s]."""


class BufferedSocket:
    """A connected socket whose `sendall` never waits: messages are buffered until the next flush, and sent in order.

    A flush sends at once: rospy's subscribers request TCP_NODELAY only with an option, whatever the publisher's
    setting. Without it, a message waits until the previous one is acknowledged, up to 40 ms.

    Any thread may use it. Messages that the other side does not accept yet stay buffered; beyond `limit` messages the
    oldest are dropped.
    """

    def __init__(self, connection: socket.socket, limit: int) -> None:
        connection.setblocking(False)  # else Python would wait for rospy's timeout
        if connection.family in (socket.AF_INET, socket.AF_INET6):
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket = connection
        self._lock = threading.Lock()
        self._begun = b""  # rest of a partly sent message
        self._kept: deque[bytes] = deque(maxlen=limit)
        self._most_together = min(limit, MAX_TOGETHER)
        self._error: OSError | None = None
        """Error that closed the connection; None while it is open."""

    def __getattr__(self, name: str) -> Any:
        return getattr(self._socket, name)

    def sendall(self, data: bytes) -> None:
        """Buffers a message for the next flush; flushes now if many are buffered.

        Raises:

            OSError: If an earlier call found the connection closed.
        """
        with self._lock:
            if self._error is not None:
                raise self._error
            self._kept.append(data)
            _unsent[self] = None
            if _at_once.is_set() or len(self._kept) >= self._most_together:
                self._send_kept()

    def flush(self) -> None:
        """Sends buffered messages as far as the other side accepts them; if the connection is closed, sending the next
        message raises an error."""
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
"""Sockets with buffered messages, in the order of their first one."""


def send_at_once() -> None:
    """Flushes, and sends every message at once from now on; called when the loop that flushes ends."""
    _at_once.set()
    flush_buffered_sockets()


def flush_buffered_sockets() -> None:
    """Sends buffered messages as far as they are accepted; for every pass of a loop."""
    for each in tuple(_unsent):
        each.flush()


class _Pending(NamedTuple):
    """A connection whose header is incomplete; it is closed at `end_s` of the monotonic clock."""

    connection: socket.socket
    address: Any
    end_s: float


class ServerSocket:
    """A listening socket that returns connections whose TCPROS header has arrived, so that rospy need not wait for it.

    rospy reads the header of a connection in its only accepting thread. A client that sends none, for example a program
    that was just stopped or one with another protocol, would keep all others from the topics and services of the node
    forever. Here connections wait in parallel. A node without free file handles waits, where rospy would never accept a
    connection again.

    Args:
        server: The socket.
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
        """Waits for the next connection whose header has arrived, and returns it with its address."""
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
        """Marks a connection as ready if its header has arrived; closes it if no header can arrive."""
        try:
            peeked = pending.connection.recv(PEEKED, socket.MSG_PEEK | socket.MSG_DONTWAIT)
        except BlockingIOError:
            return
        except OSError:
            peeked = b""
        if not peeked:  # it is closed
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
