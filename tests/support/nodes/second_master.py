"""A ROS master that tests may kill and start again; the tests' own one goes on."""

from __future__ import annotations

import os
import signal
import subprocess
from typing import Any

import rosgraph
from ros_system import wait_until
from workplace import Port

KINDS = ("publishes", "subscribes", "serves")


class SecondMaster:
    """A master at an address of its own.

    Args:
        ros: Starts programs.

    Attributes:
        uri: Its address.
        environment: What programs need to find it.
        api: What it knows.
    """

    def __init__(self, ros: Any) -> None:
        self._ros = ros
        self._port = Port()
        self.uri = self._port.uri
        self.environment = {"ROS_MASTER_URI": self.uri}
        self.api = rosgraph.Master("/tests", master_uri=self.uri)
        self.start()

    def start(self) -> None:
        """Starts it, with an empty memory."""
        command = ["rosmaster", "--core", "-p", str(self._port.number)]
        self.process: subprocess.Popen[bytes] = self._ros.start(command, log="master.log", **self.environment)
        wait_until(self.api.is_online, "the second master answers")

    def kill(self) -> None:
        """Ends it at once."""
        os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()

    def registrations(self, node: str) -> list[tuple[str, str]]:
        """Returns all that a node has there."""
        return sorted(
            (kind, name)
            for kind, entries in zip(KINDS, self.api.getSystemState(), strict=True)
            for name, nodes in entries
            if node in nodes
        )

    def has(self, service: str) -> bool:
        """Tells whether a service is known."""
        try:
            return bool(self.api.lookupService(service))
        except rosgraph.MasterError:
            return False
