"""The socket at which a node listens: nobody who connects to it holds up others."""

from __future__ import annotations

import contextlib
import errno
import logging
import select
import socket
import struct
import time
from collections import deque
from typing import Any, NamedTuple

log = logging.getLogger(__name__)

PATIENCE_S = 60.0
"""How long after it has connected a node may take to say what it wants [s]."""
LARGEST_HEADER = 1 << 20
"""Bytes; the first four bytes of other protocols, taken for its length, say more."""
ENOUGH = 1 << 15
"""Of a longer header so many bytes will do, since the kernel does not keep any number of them."""
OUT_OF_HANDLES_S = 0.5
"""How long a node that is out of file handles waits before it looks again [s]."""


class _Visitor(NamedTuple):
    """Who has connected, but not said yet what it wants; until `end_s` it may."""

    connection: socket.socket
    address: Any
    end_s: float


class ServerSocket:
    """A listening socket that hands on only who has said what it wants, as far as rospy reads it in one go.

    rospy reads the header of a connection in the only thread that accepts any. So one that says nothing, be it a
    program that was stopped just then or one that speaks another protocol, would keep all others from the topics and
    services of the node for ever. Here they wait beside each other. A node that is out of file handles waits, where
    rospy would never accept anybody again.

    Args:
        server: The socket.
    """

    def __init__(self, server: socket.socket) -> None:
        self._server, self._server_file = server, server.fileno()
        self._visitors: dict[int, _Visitor] = {}
        self._ready: deque[_Visitor] = deque()
        self._poll = select.epoll()
        self._poll.register(self._server_file, select.EPOLLIN)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._server, name)

    def accept(self) -> tuple[socket.socket, Any]:
        """Waits for the next connection that can be served, and returns it with its address.

        Raises:
            TimeoutError: If there are no file handles; one may ask again.
            OSError: If the socket cannot accept any more.
        """
        while not self._ready:
            now_s = time.monotonic()
            for visitor in [each for each in self._visitors.values() if each.end_s <= now_s]:
                self._send_away(visitor, f"it has said nothing for {PATIENCE_S:g} s")
            next_s = min((each.end_s for each in self._visitors.values()), default=None)
            files = {file for file, _ in self._poll.poll(None if next_s is None else next_s - now_s)}
            for visitor in [self._visitors[file] for file in files - {self._server_file}]:
                self._hear(visitor)
            if self._server_file in files:
                self._admit()
        visitor = self._ready.popleft()
        return visitor.connection, visitor.address

    def _admit(self) -> None:
        try:
            connection, address = self._server.accept()
        except OSError as error:
            if error.errno not in (errno.EMFILE, errno.ENFILE):
                raise
            time.sleep(OUT_OF_HANDLES_S)
            raise TimeoutError from None
        self._visitors[connection.fileno()] = _Visitor(connection, address, time.monotonic() + PATIENCE_S)
        # Told of once for all that has come, as it is not read here
        self._poll.register(connection.fileno(), select.EPOLLIN | select.EPOLLRDHUP | select.EPOLLET)

    def _hear(self, visitor: _Visitor) -> None:
        """Lets a visitor in if it has said what it wants."""
        try:
            said = visitor.connection.recv(ENOUGH, socket.MSG_PEEK | socket.MSG_DONTWAIT)
        except BlockingIOError:
            return
        except OSError:
            said = b""
        if not said:  # it has gone
            self._forget(visitor)
            visitor.connection.close()
        elif len(said) >= 4:
            size = struct.unpack("<I", said[:4])[0]
            if not 0 < size <= LARGEST_HEADER:
                self._send_away(visitor, f"it does not speak TCPROS: {said[:20]!r}")
            elif len(said) >= min(4 + size, ENOUGH):
                self._forget(visitor)
                self._ready.append(visitor)

    def _send_away(self, visitor: _Visitor, why: str) -> None:
        self._forget(visitor)
        visitor.connection.close()
        log.warning("connection from %s closed: %s", visitor.address, why)

    def _forget(self, visitor: _Visitor) -> None:
        file = visitor.connection.fileno()
        del self._visitors[file]
        with contextlib.suppress(OSError):
            self._poll.unregister(file)
