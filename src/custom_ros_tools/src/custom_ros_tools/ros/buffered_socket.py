"""Sending without threads and without waiting."""

import socket
import threading
from collections import deque
from typing import Any

MOST_TOGETHER = 32
"""How many messages are sent by one call of the system, and kept at most until the next flush."""


class BufferedSocket:
    """A connected socket whose `sendall` never waits: messages are kept until the next flush, and are sent in order.

    What is flushed goes out at once: rospy's subscribers ask for no TCP_NODELAY unless they are told to, whatever the
    publisher says, and then a message waits until the one before it is acknowledged, up to 40 ms.

    Any thread may use it. What the other side does not take yet stays; beyond `limit` messages the oldest are dropped.
    """

    def __init__(self, connection: socket.socket, limit: int) -> None:
        connection.setblocking(False)  # rospy's sockets have a timeout, for which Python would wait whatever the flags
        if connection.family in (socket.AF_INET, socket.AF_INET6):
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket = connection
        self._lock = threading.Lock()
        self._begun = b""  # rest of messages of which a part was sent
        self._kept: deque[bytes] = deque(maxlen=limit)
        self._most_together = min(limit, MOST_TOGETHER)
        self._error: OSError | None = None
        """Why the other side cannot be reached any more."""

    def __getattr__(self, name: str) -> Any:
        return getattr(self._socket, name)

    def sendall(self, data: bytes) -> None:
        """Has a message sent by the next flush, or now if many are kept already.

        Raises:
            OSError: If the other side has gone, as was seen before.
        """
        with self._lock:
            if self._error is not None:
                raise self._error
            self._kept.append(data)
            _unsent[self] = None
            if _at_once.is_set() or len(self._kept) >= self._most_together:
                self._send_kept()

    def flush(self) -> None:
        """Sends what is kept as far as the other side takes it; if that has gone, the next message is an error."""
        with self._lock:
            self._send_kept()

    def _send_kept(self) -> None:
        while True:
            if not self._begun:
                if not self._kept:
                    _unsent.pop(self, None)
                    return
                count = min(len(self._kept), MOST_TOGETHER)
                self._begun = b"".join([self._kept.popleft() for _ in range(count)])
            try:
                self._begun = self._begun[self._socket.send(self._begun) :]
            except BlockingIOError:
                return
            except OSError as error:
                self._error, self._begun = error, b""
                self._kept.clear()


_unsent: dict[BufferedSocket, None] = {}
"""Those that keep something, in the order in which they began to."""


_at_once = threading.Event()
"""Set once nobody flushes any more."""


def send_at_once() -> None:
    """Sends what is kept, and from now on every message at once: for the end of a loop that has flushed."""
    _at_once.set()
    flush_buffered_sockets()


def flush_buffered_sockets() -> None:
    """Sends what is kept, as far as it is taken; for every pass of a loop."""
    for each in tuple(_unsent):
        each.flush()
