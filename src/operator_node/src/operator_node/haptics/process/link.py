"""Python objects between two processes, without ever waiting for the other one, and without piling up."""

import pickle
import select
import socket
from collections.abc import Iterator
from typing import Any

LONGEST = 1 << 16
"""Longest message [bytes]."""


class Link:
    """Sends and receives picklable objects over a connected socket that keeps messages apart (SOCK_SEQPACKET).

    The kernel keeps what the other side has not taken yet, some 200 messages; what it has no room for is lost. A
    process that ends, however it does, closes its side at that moment.

    Args:
        connection: The socket; it belongs to the link from now on.

    Attributes:
        is_closed: Whether one of both sides has gone.
    """

    def __init__(self, connection: socket.socket) -> None:
        connection.setblocking(False)
        self._socket = connection
        self._buffer = memoryview(bytearray(LONGEST))
        self.is_closed = False

    def send(self, item: Any) -> bool:
        """Sends an object, and returns False if the other side is so far behind that it was lost."""
        try:
            self._socket.send(pickle.dumps(item, protocol=pickle.HIGHEST_PROTOCOL))
        except BlockingIOError:
            return False
        except OSError:
            self.is_closed = True
        return True

    def receive(self) -> Iterator[Any]:
        """Yields the objects that have come since the last time, in order."""
        return map(pickle.loads, self._packets())

    def newest(self) -> Any:
        """Returns the last of them, None if there is none; the others are dropped."""
        newest = None
        for packet in self._packets():
            newest = packet
        return newest and pickle.loads(newest)

    def wait(self, timeout_s: float | None = None) -> None:
        """Waits until something comes or the other side goes, for at most so long [s]."""
        if not self.is_closed:
            select.select([self._socket], [], [], timeout_s)

    def close(self) -> None:
        """Ends the connection; the other side notices, and so does who waits here."""
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
