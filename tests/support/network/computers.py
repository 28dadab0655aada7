"""Two computers on one: network namespaces that are joined by a cable, and by a radio with delay and jitter."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import subprocess
import sys

from ros_system import SUPPORT, RosSystem, find_executable, wait_until

MASTER_PORT = 11500
CABLE, RADIO = "cable0", "radio0"
_HOLD = ("setpriv", "--pdeathsig", "KILL", "unshare", "--net", "sleep", "infinity")
"""Holds a namespace, which is gone with it; it ends with the thread that started it."""


def why_not() -> str:
    """Returns why there can be no second computer here; an empty text if there can."""
    missing = [name for name in ("ip", "nsenter", "setpriv", "unshare") if shutil.which(name) is None]
    if missing:
        return f"no {', '.join(missing)}"
    tried = subprocess.run(
        ["unshare", "--net", "ip", "link", "add", "cable0", "type", "veth"], capture_output=True, text=True
    )
    if tried.returncode:
        return f"network namespaces are not permitted: {tried.stderr.strip()}"
    return "" if os.access("/dev/net/tun", os.R_OK | os.W_OK) else "no /dev/net/tun"


class Computer:
    """A network namespace.

    Args:
        ros: Starts programs.
        number: Last byte of its addresses.

    Attributes:
        cable_ip: Its address on the cable.
        radio_ip: Its address on the radio.
    """

    def __init__(self, ros: RosSystem, number: int) -> None:
        self._ros = ros
        self.cable_ip, self.radio_ip = f"10.77.0.{number}", f"10.78.0.{number}"
        self._holder = subprocess.Popen(_HOLD, start_new_session=True)
        self.net = f"/proc/{self._holder.pid}/ns/net"
        ours = os.readlink("/proc/self/ns/net")
        wait_until(lambda: os.readlink(self.net) != ours, "there is a namespace")
        self.ip("link", "set", "lo", "up")

    def ip(self, *arguments: str) -> None:
        """Runs the command `ip` on it."""
        subprocess.run(self._inside("ip", *arguments), check=True, capture_output=True)

    def start(self, *command: str, master: str, **environment: str) -> subprocess.Popen[bytes]:
        """Starts a program on it, which knows the master; `rosrun` goes first as usual."""
        if command[0] == "rosrun":
            command = (find_executable(command[1], command[2]), *command[3:])
        settings = {"ROS_MASTER_URI": master, "ROS_IP": self.cable_ip, **environment}
        return self._ros.start(self._inside(*command), **settings)

    def run(self, *command: str, master: str, **environment: str) -> str:
        """Runs a program on it to its end, and returns what it printed."""
        settings = {**os.environ, "ROS_MASTER_URI": master, "ROS_IP": self.cable_ip, **environment}
        done = subprocess.run(self._inside(*command), env=settings, capture_output=True, text=True, timeout=120)
        return done.stdout + done.stderr

    def close(self) -> None:
        """Ends the namespace."""
        self._holder.kill()
        self._holder.wait()

    def _inside(self, *command: str) -> list[str]:
        return ["nsenter", f"--net={self.net}", *command]


class TwoComputers:
    """Two computers with a ROS master on the first.

    Attributes:
        first: Has the master, at `master`.
        second: The other one.
    """

    def __init__(self, ros: RosSystem) -> None:
        self._ros = ros
        self.first, self.second = Computer(ros, 1), Computer(ros, 2)
        other = str(self.second._holder.pid)
        self.first.ip("link", "add", CABLE, "type", "veth", "peer", "name", CABLE, "netns", other)
        for computer in (self.first, self.second):
            computer.ip("address", "add", f"{computer.cable_ip}/24", "dev", CABLE)
            computer.ip("link", "set", CABLE, "up")
        self.master = f"http://{self.first.cable_ip}:{MASTER_PORT}"
        self.first.start("rosmaster", "--core", "-p", str(MASTER_PORT), master=self.master)
        self._radio: subprocess.Popen[bytes] | None = None

    def registered(self, node: str) -> bool:
        """Tells whether the master knows a node."""
        return node in self.on(self.first, "rosnode", "list").split()

    def on(self, computer: Computer, *command: str) -> str:
        """Runs a program on one of them to its end, and returns what it printed."""
        return computer.run(*command, master=self.master)

    def plug(self, is_in: bool) -> None:
        """Plugs the cable in, or pulls it out."""
        self.first.ip("link", "set", CABLE, "up" if is_in else "down")

    def switch_radio_on(self, delay_s: float, jitter_s: float) -> None:
        """Joins them by a second link, on which each packet takes so long, and up to `jitter_s` more."""
        arguments = (self.first.net, self.second.net, str(delay_s), str(jitter_s))
        self._radio = self._ros.start([sys.executable, str(SUPPORT / "programs/slow_link.py"), RADIO, *arguments])
        wait_until(lambda: "ready" in self._ros.output(self._radio), "the radio is there")
        for computer in (self.first, self.second):
            computer.ip("address", "add", f"{computer.radio_ip}/24", "dev", RADIO)
            computer.ip("link", "set", RADIO, "up")

    def close(self) -> None:
        """Ends both, after all that runs on them."""
        if self._radio is not None:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self._radio.pid, signal.SIGKILL)
        self.first.close()
        self.second.close()
