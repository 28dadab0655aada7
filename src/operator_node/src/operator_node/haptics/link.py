"""Connection between the haptic node and the loop's process: message types, and their transport."""

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
        value: Force on the tool [N], or displacement of the tool since the start [m], in the tool's axes.
        at_s: Time of arrival, by the monotonic clock, which is the same in all processes [s].
        delay_s: Age of the sample at arrival [s].
    """

    value: Vector
    at_s: float
    delay_s: float


class LoopCommand(NamedTuple):
    """Command of the node to the loop. The node repeats commands, so that the loop detects when the node has stopped.

    Attributes:
        is_on: Whether the device should be open.
        switched: Number of times that the node switched the device on or off.
        resets: Number of times that the node moved the target back to its start.
        wrench: The newest force on the tool; None before the first.
        tool: The newest displacement of the tool; None before the first.
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
        config: Parameters of the mapping and the forces, and the rate of reports.
        command: The present command.
        displacement: Initial displacement of the target from its start, in the tool's axes [m]. It is not 0 if the
            process is restarted after a crash.
    """

    device: type[HapticDevice]
    options: HapticConfig
    config: HapticNodeConfig
    command: LoopCommand = LoopCommand()
    displacement: Vector = ZERO


class LoopReport(NamedTuple):
    """State of the loop.

    Attributes:
        obeyed: `LoopCommand.switched` of the last executed command.
        resets: `LoopCommand.resets` of the last executed command.
        is_connected: Whether the device is open.
        has_ended: True if the device must not be opened again, because the user closed it or a library is missing.
        trouble: Reason why the device is not open; empty while it is open.
        samples: Number of readings so far.
        lateness_s: Largest lateness of a tick since the last report [s].
        force: Force that is sent to the device, in the device's axes [N].
        snapshot: Result for the last valid reading; None before the first.
        delay_s: Age of the tool sample that is rendered [s]; infinite without a sample.
        fault: Fault of the last reading; empty if the last reading was valid.
        faults: Number of refused readings, keyed by fault.
        energy_j: Energy that the user has put in, minus the energy that the device has returned [J].
        energy_bound_j: Lower bound of `energy_j` [J].
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
    """Sends and receives picklable objects over a connected socket with message boundaries (SOCK_SEQPACKET).

    The kernel buffers some 200 unread messages; further messages are dropped. When a process ends for any reason, the
    kernel closes that process's end of the connection at once.

    Args:
        connection: The socket. The link closes it.

    Attributes:
        is_closed: Whether one end of the connection is closed.
    """

    def __init__(self, connection: socket.socket) -> None:
        connection.setblocking(False)
        self._socket = connection
        self._buffer = memoryview(bytearray(MAX_MESSAGE_BYTES))
        self.is_closed = False

    def send(self, item: Any) -> bool:
        """Sends an object. Returns False if the object was dropped because the buffer is full."""
        try:
            self._socket.send(pickle.dumps(item, protocol=pickle.HIGHEST_PROTOCOL))
        except BlockingIOError:
            return False
        except OSError:
            self.is_closed = True
        return True

    def receive(self) -> Iterator[Any]:
        """Yields the objects that were received since the last call, in order."""
        return map(pickle.loads, self._packets())

    def newest(self) -> Any:
        """Returns the last object that was received since the last call, or None. Drops earlier objects."""
        newest = None
        for packet in self._packets():
            newest = packet
        return newest and pickle.loads(newest)

    def wait(self, timeout_s: float | None = None) -> None:
        """Waits until a message arrives or the connection is closed, for at most `timeout_s` [s]."""
        if not self.is_closed:
            select.select([self._socket], [], [], timeout_s)

    def close(self) -> None:
        """Closes the connection. Calls of `wait` return, in this process and at the other end."""
        self.is_closed = True
        try:
            self._socket.shutdown(socket.SHUT_RDWR)
        except OSError:
            return  # the other end is closed already

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
