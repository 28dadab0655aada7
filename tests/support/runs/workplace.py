"""A place of its own for each process that runs tests: ROS master, home and logs, none of them anybody else's."""

from __future__ import annotations

import os
import signal
import socket
import tempfile
from pathlib import Path

PORTS = range(21000, 22000)
"""Ports for masters, below those that the kernel gives to clients."""
FOREIGN_SETTINGS = ("DISPLAY", "WAYLAND_DISPLAY", "ROS_HOSTNAME", "ROS_NAMESPACE", "ROS_LOG_DIR")
"""Environment variables of whoever starts the tests that would reach into them."""


class Port:
    """A TCP port that nobody uses, and that no other process takes by this class while this object lives.

    Attributes:
        number: The port.

    Raises:
        OSError: If there is none.
    """

    def __init__(self) -> None:
        for number in PORTS:
            self._claim = socket.socket(socket.AF_UNIX)
            try:
                self._claim.bind(f"\0rpbi-tests-port-{number}")  # the kernel drops the claim with the process
                with socket.socket() as probe:
                    probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
                    probe.bind(("", number))
            except OSError:
                self._claim.close()
            else:
                self.number = number
                return
        raise OSError(f"no port of {PORTS} is free")

    @property
    def uri(self) -> str:
        """Address of a ROS master at this port."""
        return f"http://127.0.0.1:{self.number}"


class Workplace:
    """Sets the environment of this process and of what it starts; must be made before rospy is imported.

    Attributes:
        folder: What ROS and other programs write of themselves goes there.
        port: Where the ROS master of this process belongs.
    """

    def __init__(self) -> None:
        self._temporary = tempfile.TemporaryDirectory(prefix="rpbi-tests-")
        self.folder = Path(self._temporary.name)
        self.port = Port()
        home, run = self.folder / "home", self.folder / "run"
        home.mkdir()
        run.mkdir(mode=0o700)
        for name in FOREIGN_SETTINGS:
            os.environ.pop(name, None)
        os.environ.update(
            ROS_MASTER_URI=self.port.uri,
            ROS_IP="127.0.0.1",
            ROS_HOME=str(self.folder),
            HOME=str(home),
            XDG_RUNTIME_DIR=str(run),
            OPENBLAS_NUM_THREADS="1",  # else each import of numpy has threads of the other processors spin for 0.1 s
        )
        if "PYTEST_XDIST_WORKER" not in os.environ:  # all workers share what is made once, such as trials of meshes
            os.environ["XDG_CACHE_HOME"] = str(self.folder / "cache")
        if os.environ.pop("PYTHONDONTWRITEBYTECODE", None):  # else each of a thousand nodes would compile its modules
            os.environ["PYTHONPYCACHEPREFIX"] = str(Path(__file__).resolve().parents[3] / ".rpbi/pycache")
        if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:  # so it is behind the `&` of a script
            signal.signal(signal.SIGINT, signal.default_int_handler)

    def processes(self) -> dict[int, str]:
        """Returns the command lines of all processes that were started here and live, by process id."""
        mark = f"\0ROS_HOME={self.folder}\0".encode()
        found = {}
        for path in Path("/proc").glob("[0-9]*"):
            try:
                if mark in b"\0" + (path / "environ").read_bytes():
                    found[int(path.name)] = (path / "cmdline").read_text(errors="replace").replace("\0", " ").strip()
            except OSError:  # it has just ended, or is somebody else's
                continue
        found.pop(os.getpid(), None)
        return found
