"""Connection to the ROS master, which detects at once when the master's process ends."""

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
    """Keeps an idle connection to the ROS master open. The connection closes when the master's process ends.

    A master that hangs, or a pulled cable, is not detected.

    Args:
        lost: Called in a separate thread when the master has ended.

    Attributes:
        uri: The master's address.
        is_there: Whether the connection is open.
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
