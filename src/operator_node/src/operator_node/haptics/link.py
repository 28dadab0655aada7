"""Connection between the node and the loop's process: messages, and their transport."""

import math
import pickle
import select
import socket
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from robot_model.geometry import ZERO, Vector

from .config import HapticNodeConfig
from .controller import Snapshot
from .device import HapticConfig, HapticDevice

MAX_MESSAGE_BYTES = 1 << 16
"""Longest message [bytes]."""


class LoopInput(NamedTuple):
    """A sample of the tool from the simulator.

    Attributes:
        value: Force on the tool [N], or displacement of the tool since the start [m], in its axes.
        at_s: Time of arrival, by the monotonic clock, which all processes share [s].
        delay_s: Age of the sample at arrival [s].
    """

    value: Vector
    at_s: float
    delay_s: float


class LoopCommand(NamedTuple):
    """Command of the node to the loop; repeated, so that the loop detects when the node has stopped.

    Attributes:
        is_on: Whether the device is to be open.
        switched: Number of times that this was changed.
        resets: Number of times that the target was returned to its start.
        wrench: The newest force on the tool.
        tool: The newest displacement of the tool.
    """

    is_on: bool = False
    switched: int = 0
    resets: int = 0
    wrench: LoopInput | None = None
    tool: LoopInput | None = None


class Setup(NamedTuple):
    """First message to the loop's process.

    Attributes:
        device: Class of the device.
        options: Options of the device.
        config: The mapping, the forces, and the rate of reports.
        command: The present command.
        displacement: Displacement of the target from its start [m]; not 0 if an earlier process has moved it.
    """

    device: type[HapticDevice]
    options: HapticConfig
    config: HapticNodeConfig
    command: LoopCommand = LoopCommand()
    displacement: Vector = ZERO


class LoopReport(NamedTuple):
    """State of the loop.

    Attributes:
        obeyed: `LoopCommand.switched` of the command that has been carried out.
        resets: `LoopCommand.resets` of the command that has been carried out.
        is_connected: Whether the device is open.
        has_ended: Whether the user has finished with it, or a library is missing.
        trouble: Why it is not open; empty if it is.
        samples: Number of readings.
        lateness_s: Largest lateness of a tick since the last report [s].
        force: Force that is sent to the device [N].
        snapshot: Result of the last valid reading.
        delay_s: Age of the sample that is rendered; infinite without any [s].
        fault: Last fault of a refused reading; empty if readings are valid.
        faults: Number of refused readings, by fault.
        energy_j: Energy that the user has put in, less the energy given back [J].
        energy_bound_j: Least value of that energy [J].
        interventions: Number of samples at which the passivity controller changed the force.
    """

    obeyed: int = 0
    resets: int = 0
    is_connected: bool = False
    has_ended: bool = False
    trouble: str = "not opened yet"
    samples: int = 0
    lateness_s: float = 0.0
    force: Vector = ZERO
    snapshot: Snapshot | None = None
    delay_s: float = math.inf
    fault: str = ""
    faults: Mapping[str, int] = {}
    energy_j: float = 0.0
    energy_bound_j: float = 0.0
    interventions: int = 0


class Link:
    """Sends and receives picklable objects over a connected socket that preserves messages (SOCK_SEQPACKET).

    The kernel buffers some 200 messages that the other side has not read yet; further ones are dropped. When a process
    ends, for whatever reason, its side is closed at that moment.

    Args:
        connection: The socket; it belongs to the link from now on.

    Attributes:
        is_closed: Whether one of both sides has gone.
    """

    def __init__(self, connection: socket.socket) -> None:
        connection.setblocking(False)
        self._socket = connection
        self._buffer = memoryview(bytearray(MAX_MESSAGE_BYTES))
        self.is_closed = False

    def send(self, item: Any) -> bool:
        """Sends an object; returns False if it was dropped because the other side is too far behind."""
        try:
            self._socket.send(pickle.dumps(item, protocol=pickle.HIGHEST_PROTOCOL))
        except BlockingIOError:
            return False
        except OSError:
            self.is_closed = True
        return True

    def receive(self) -> Iterator[Any]:
        """Yields the objects received since the last call, in order."""
        return map(pickle.loads, self._packets())

    def newest(self) -> Any:
        """Returns the last of them, or None; drops the others."""
        newest = None
        for packet in self._packets():
            newest = packet
        return newest and pickle.loads(newest)

    def wait(self, timeout_s: float | None = None) -> None:
        """Waits until something is received or the other side goes, for at most `timeout_s`."""
        if not self.is_closed:
            select.select([self._socket], [], [], timeout_s)

    def close(self) -> None:
        """Closes the connection; wakes up the other side and any `wait` here."""
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
