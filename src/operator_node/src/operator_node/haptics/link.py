"""Python objects between two processes, without waiting for the other one and with a bounded queue."""

import pickle
import select
import socket
from collections.abc import Iterator
from typing import Any

MAX_MESSAGE_BYTES = 1 << 16
"""Longest message [bytes]."""


class Link:
    """Sends and receives picklable objects over a connected socket that preserves messages (SOCK_SEQPACKET).

    The kernel buffers some 200 messages that the other side has not read yet; further ones are dropped. When a process
    ends, for whatever reason, its side is closed at that moment.

    Args:
        connection: The socket; it belongs to the link from now on.

    Attributes:
        is_closed: Whether one of both sides has gone.
    """

    def __init__(self, connection: socket.socket) -> None:
        connection.setblocking(False)
        self._socket = connection
        self._buffer = memoryview(bytearray(MAX_MESSAGE_BYTES))
        self.is_closed = False

    def send(self, item: Any) -> bool:
        """Sends an object; returns False if it was dropped because the other side is too far behind."""
        try:
            self._socket.send(pickle.dumps(item, protocol=pickle.HIGHEST_PROTOCOL))
        except BlockingIOError:
            return False
        except OSError:
            self.is_closed = True
        return True

    def receive(self) -> Iterator[Any]:
        """Yields the objects received since the last call, in order."""
        return map(pickle.loads, self._packets())

    def newest(self) -> Any:
        """Returns the last of them, or None; drops the others."""
        newest = None
        for packet in self._packets():
            newest = packet
        return newest and pickle.loads(newest)

    def wait(self, timeout_s: float | None = None) -> None:
        """Waits until something is received or the other side goes, for at most `timeout_s`."""
        if not self.is_closed:
            select.select([self._socket], [], [], timeout_s)

    def close(self) -> None:
        """Closes the connection; wakes up the other side and any `wait` here."""
        self.is_closed = True
        try:
            self._socket.shutdown(socket.SHUT_RDWR)
        except OSError:
            return  # the other side has gone

    def _packets(self) -> Iterator[bytes]:
        while not self.is_closed:
            try:
                size = self._socket.recv_into(self._buffer)
            except BlockingIOError:
                return
            except OSError:
                size = 0
            if size == 0:
                self.is_closed = True
                return
            yield bytes(self._buffer[:size])
