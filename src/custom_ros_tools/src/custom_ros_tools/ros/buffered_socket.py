"""Sending without threads and without waiting."""

import socket
import threading
from collections import deque
from typing import Any

MAX_TOGETHER = 32
"""Largest number of messages that are buffered until the next flush and sent by one system call."""


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
        """Why the other side cannot be reached any more."""

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


_at_once = threading.Event()
"""Set once nothing flushes any more."""


def send_at_once() -> None:
    """Flushes, and sends every message at once from now on; called when the loop that flushes ends."""
    _at_once.set()
    flush_buffered_sockets()


def flush_buffered_sockets() -> None:
    """Sends buffered messages as far as they are accepted; for every pass of a loop."""
    for each in tuple(_unsent):
        each.flush()
