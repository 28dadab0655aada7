"""Sending without threads and without waiting."""

from __future__ import annotations

import socket
from collections import deque
from typing import Any


class BufferedSocket:
    """A connected socket whose `sendall` never waits: what the other side does not take yet is kept in order.

    Args:
        connection: The socket.
        limit: Messages kept; beyond it the oldest are dropped.
    """

    def __init__(self, connection: socket.socket, limit: int) -> None:
        connection.setblocking(False)  # rospy's sockets have a timeout, for which Python would wait whatever the flags
        self._socket = connection
        self._begun = b""  # rest of a message of which a part was sent
        self._kept: deque[bytes] = deque(maxlen=limit)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._socket, name)

    def sendall(self, data: bytes) -> None:
        """Sends a message, now or with a later call.

        Raises:
            OSError: If the other side has gone.
        """
        if self._begun or self._kept:
            self._kept.append(data)
            self.flush()
        else:
            self._begun = self._send(data)

    def flush(self) -> None:
        """Sends what is kept as far as the other side takes it.

        Raises:
            OSError: If the other side has gone.
        """
        self._begun = self._send(self._begun)
        while self._kept and not self._begun:
            self._begun = self._send(self._kept.popleft())

    def _send(self, data: bytes) -> bytes:
        """Sends what can be sent at once and returns the rest."""
        try:
            return data[self._socket.send(data) :] if data else data
        except BlockingIOError:
            return data
