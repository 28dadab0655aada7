"""A connection to the ROS master that shows at once when it dies."""

import socket
import threading
import time
from collections.abc import Callable
from urllib.parse import urlparse

import rosgraph
import rospy

RETRY_S = 0.2
TIMEOUT_S = 1.0


class MasterConnection:
    """Holds a connection to the ROS master open, over which nothing is sent: its end is that of the master's process.

    A master that hangs, or a cable that is pulled, does not show.

    Args:
        lost: Is called when the master has gone, by a thread of its own.

    Attributes:
        uri: The master's address.
        is_there: Whether the master is there.
    """

    def __init__(self, lost: Callable[[], None]) -> None:
        self.uri = rosgraph.get_master_uri()
        self._lost = lost
        self._socket = self._connected()
        self.is_there = self._socket is not None
        threading.Thread(target=self._run, name="master connection", daemon=True).start()

    def _connected(self) -> socket.socket | None:
        address = urlparse(self.uri)
        try:
            connection = socket.create_connection((address.hostname, address.port), TIMEOUT_S)
        except OSError:
            return None
        connection.settimeout(None)
        return connection

    def _run(self) -> None:
        while not rospy.is_shutdown():
            if self._socket is None:
                time.sleep(RETRY_S)
                self._socket = self._connected()
                self.is_there = self._socket is not None
                continue
            with self._socket as connection:
                try:
                    while connection.recv(1):
                        pass
                except OSError:
                    pass
            self._socket, self.is_there = None, False
            self._lost()
