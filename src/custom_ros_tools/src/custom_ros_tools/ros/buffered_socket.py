"""Sending without threads and without waiting."""

import socket
import threading
from collections import deque
from typing import Any


class BufferedSocket:
    """A connected socket whose `sendall` never waits: what the other side does not take yet is kept in order.

    Any thread may use it. Beyond `limit` messages that are kept, the oldest are dropped.
    """

    def __init__(self, connection: socket.socket, limit: int) -> None:
        connection.setblocking(False)  # rospy's sockets have a timeout, for which Python would wait whatever the flags
        self._socket = connection
        self._lock = threading.Lock()
        self._begun = b""  # rest of a message of which a part was sent
        self._kept: deque[bytes] = deque(maxlen=limit)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._socket, name)

    def sendall(self, data: bytes) -> None:
        """Sends a message, now or with a later call.

        Raises:
            OSError: If the other side has gone.
        """
        with self._lock:
            self._kept.append(data)
            self._send_kept()

    def flush(self) -> None:
        """Sends what is kept as far as the other side takes it; forgets it if the other side has gone."""
        with self._lock:
            try:
                self._send_kept()
            except OSError:  # rospy looks for broken connections by itself, and closes them
                self._begun = b""
                self._kept.clear()
                _unsent.discard(self)

    def _send_kept(self) -> None:
        self._begun = self._send(self._begun)
        while self._kept and not self._begun:
            self._begun = self._send(self._kept.popleft())
        if self._begun:
            _unsent.add(self)
        elif _unsent:
            _unsent.discard(self)

    def _send(self, data: bytes) -> bytes:
        """Sends what can be sent at once and returns the rest."""
        try:
            return data[self._socket.send(data) :] if data else data
        except BlockingIOError:
            return data


_unsent: set[BufferedSocket] = set()
"""Those that keep something."""


def flush_buffered_sockets() -> None:
    """Sends what slow subscribers have not taken yet, as far as they take it; for every pass of a loop."""
    for each in tuple(_unsent):
        each.flush()
