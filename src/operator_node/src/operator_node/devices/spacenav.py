"""A 6-D mouse, by the daemon spacenavd or another one that speaks its protocol."""

import contextlib
import math
import os
import select
import socket
import struct
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from pydantic import Field

from custom_ros_tools.schema import ConfigModel, Count, NonNegative, Positive, Switch, Text, Vec3, optional
from operator_node.device import Device, DeviceError, Reading

SOCKET, SETTINGS = "/var/run/spnav.sock", "/etc/spnavrc"
PACKET = struct.Struct("=8i")
WORD = struct.Struct("=i")
REQUEST = 0x7FAA0000
"""What is added to the types of requests, and of the answers to them."""
PROTOCOL_TAG = REQUEST | 0x5500
PROTOCOL_MASK = 0x7FFFFF00
"""All but the version in the word by which a version is agreed on."""
SENSITIVITY = struct.pack("=f", 1.0)
MOTION, PRESS, RELEASE, DEVICE, LAST_EVENT = 0, 1, 2, 3, 6
"""Types of packets; those up to the last one are events."""
GET_BUTTONS = REQUEST | 0x2003
ANSWERS = range(REQUEST | 0x1000, REQUEST | 0x4000)
ANSWER_TIMEOUT_S = 0.3
LARGEST = 32767
"""No 6-D mouse says more."""
MOST_BUTTONS = 64
MOST_REFUSED = 8
"""After so many packets in a row that make no sense, it is another protocol."""
POLL_S = 0.001
"""What the count of quiet polls counts in."""

Scale = Annotated[float | Vec3, Field()]


class SpacenavConfig(ConfigModel):
    """Of a 6-D mouse; the names are those of `spacenav_node`."""

    socket: Text | None = optional(
        f"Socket of the daemon; by default `$SPNAV_SOCKET`, then what `{SETTINGS}` says, then `{SOCKET}`."
    )
    full_scale: Positive = Field(512.0, description="What the device says at the end of an axis.")
    linear_scale: Scale = Field(1.0, description="Factor of `spacenav/offset` and the twist, one or one for each axis.")
    angular_scale: Scale = Field(1.0, description="Factor of `spacenav/rot_offset` and the twist, likewise.")
    zero_when_static: Switch = Field(True, description="Whether all is 0 when nothing has come for a time.")
    static_count_threshold: Count = Field(30, description="How long that time is [ms].")
    static_trans_deadband: NonNegative = Field(
        0.1, description="Without `zero_when_static`: how large the axes x, y and z may be to be 0 then."
    )
    static_rot_deadband: NonNegative = Field(0.1, description="The same of the other three.")


class Spacenav(Device):
    """A 6-D mouse.

    Axes are x forward, y left, z up and the turns about them, as shares of the full scale.
    """

    Config = SpacenavConfig
    axes = ("x", "y", "z", "rx", "ry", "rz")
    ros_topics = "operator_node.ros.devices.spacenav_topics:SpacenavTopics"

    def __init__(self, config: SpacenavConfig) -> None:
        self.buttons: Sequence[str] = ("0", "1")
        self.config = config
        self._socket: socket.socket | None = None
        self._received = bytearray()
        self._motion: tuple[float, ...] = (0.0,) * 6
        self._pressed: list[int] = []
        self._refused: list[str] = []
        self._refused_in_a_row = 0
        self._static_at_s = math.inf
        self._is_new = False

    def open(self) -> None:
        self._forget()
        path = self.config.socket or socket_path()
        self._socket = connection = socket.socket(socket.AF_UNIX)
        connection.settimeout(ANSWER_TIMEOUT_S)
        try:
            connection.connect(path)
            protocol = self._agree()
        except OSError as error:
            self.close()
            raise DeviceError("spacenav", f"no spacenavd at {path}: {error.strerror or error}") from None
        if protocol == 0:
            self._send(SENSITIVITY)
            return
        buttons = self._ask(GET_BUTTONS)
        if buttons is None:
            self.close()
            raise DeviceError("spacenav", "spacenavd has no device: is it plugged in?")
        self._have_buttons(buttons)

    def read(self, timeout_s: float) -> Reading | None:
        if self._socket is None:
            raise DeviceError("spacenav", "it is not open")
        if self._refused_in_a_row >= MOST_REFUSED:
            raise DeviceError("spacenav", "what it sends is not spacenavd's protocol")
        if not self._packets():
            self._receive(max(0.0, min(timeout_s, self._static_at_s - time.monotonic())))
        for packet in self._packets():
            self._take(packet)
            if packet[0] in (PRESS, RELEASE) or self._refused_in_a_row >= MOST_REFUSED:
                break
        if time.monotonic() >= self._static_at_s:
            self._come_to_rest()
        if not self._is_new and not self._refused:
            return None
        reading = Reading(self._motion, tuple(self._pressed), refused=tuple(self._refused))
        self._is_new, self._refused = False, []
        return reading

    def close(self) -> None:
        if self._socket is not None:
            self._socket.close()
        self._socket = None

    def _forget(self) -> None:
        self._received.clear()
        self._motion = (0.0,) * 6
        self._pressed = [0] * len(self.buttons)
        self._refused = []
        self._refused_in_a_row = 0
        self._is_new = False
        self._static_at_s = time.monotonic() + POLL_S * self.config.static_count_threshold

    # --- The connection.

    def _agree(self) -> int:
        """Asks for protocol 1 and returns which one it is; daemons that know only 0 do not answer."""
        self._send(WORD.pack(PROTOCOL_TAG | 1))
        end_s = time.monotonic() + ANSWER_TIMEOUT_S
        while len(self._received) < WORD.size:
            left_s = end_s - time.monotonic()
            if left_s <= 0.0 or not self._receive(left_s):
                return 0
        (answer,) = WORD.unpack_from(self._received)
        if answer & PROTOCOL_MASK != PROTOCOL_TAG:
            return 0  # the beginning of an event
        del self._received[: WORD.size]
        return 1

    def _ask(self, request: int) -> int | None:
        """Returns the first number of the answer, None if it is a refusal; events that come first are taken."""
        self._send(PACKET.pack(request, *[0] * 7))
        end_s = time.monotonic() + ANSWER_TIMEOUT_S
        while time.monotonic() < end_s:
            for packet in self._packets():
                if packet[0] == request:
                    return packet[1] if packet[7] == 0 else None
                self._take(packet)
            self._receive(max(0.0, end_s - time.monotonic()))
        raise DeviceError("spacenav", "spacenavd does not answer")

    def _send(self, data: bytes) -> None:
        assert self._socket is not None
        try:
            self._socket.sendall(data)
        except OSError as error:
            raise DeviceError("spacenav", f"spacenavd has gone: {error.strerror or error}") from None

    def _receive(self, timeout_s: float) -> bool:
        """Waits for bytes and returns whether some came."""
        assert self._socket is not None
        if not select.select([self._socket], [], [], timeout_s)[0]:
            return False
        try:
            received = self._socket.recv(1 << 14)
        except OSError as error:
            raise DeviceError("spacenav", f"spacenavd has gone: {error.strerror or error}") from None
        if not received:
            raise DeviceError("spacenav", "spacenavd has gone")
        self._received += received
        return True

    def _packets(self) -> "_Packets":
        return _Packets(self._received)

    # --- What it says.

    def _take(self, packet: Sequence[int]) -> None:
        reason = self._problem_of(packet)
        if reason is not None:
            self._refused.append(reason)
            self._refused_in_a_row += 1
            return
        self._refused_in_a_row = 0
        kind = packet[0]
        if kind == MOTION:
            x, y, z, rx, ry, rz = (max(-1.0, min(1.0, each / self.config.full_scale)) for each in packet[1:7])
            self._motion = (z, -x + 0.0, y, rz, -rx + 0.0, ry)
            self._static_at_s = time.monotonic() + POLL_S * self.config.static_count_threshold
            self._is_new = True
        elif kind in (PRESS, RELEASE):
            self._have_buttons(packet[1] + 1)
            self._pressed[packet[1]] = int(kind == PRESS)
            self._is_new = True
        elif kind == DEVICE and packet[1] == 1:
            raise DeviceError("spacenav", "it was unplugged")

    def _problem_of(self, packet: Sequence[int]) -> str | None:
        kind = packet[0]
        if kind == MOTION and not all(-LARGEST <= each <= LARGEST for each in packet[1:7]):
            return f"a motion beyond {LARGEST}"
        if kind in (PRESS, RELEASE) and not 0 <= packet[1] < MOST_BUTTONS:
            return f"a button outside 0 to {MOST_BUTTONS - 1}"
        if not (0 <= kind <= LAST_EVENT or kind in ANSWERS):
            return "a packet of an unknown type"
        return None

    def _have_buttons(self, count: int) -> None:
        """Has at least so many buttons; some devices say only with its event that one is there."""
        missing = min(count, MOST_BUTTONS) - len(self._pressed)
        if missing > 0:
            self._pressed += [0] * missing
            self.buttons = [*map(str, range(len(self._pressed)))]

    def _come_to_rest(self) -> None:
        """Sets to 0 what has not moved for a time."""
        config = self.config
        linear, angular = self._motion[:3], self._motion[3:]
        if config.zero_when_static or all(abs(each) < config.static_trans_deadband for each in linear):
            linear = (0.0,) * 3
        if config.zero_when_static or all(abs(each) < config.static_rot_deadband for each in angular):
            angular = (0.0,) * 3
        self._motion = (*linear, *angular)
        self._static_at_s = math.inf
        self._is_new = True


class _Packets:
    """Takes whole packets out of what was received."""

    def __init__(self, received: bytearray) -> None:
        self._received = received

    def __iter__(self) -> "_Packets":
        return self

    def __bool__(self) -> bool:
        return len(self._received) >= PACKET.size

    def __next__(self) -> tuple[int, ...]:
        if not self:
            raise StopIteration
        packet = PACKET.unpack_from(self._received)
        del self._received[: PACKET.size]
        return packet


def socket_path() -> str:
    """Returns where the socket of the daemon is, as libspnav finds it."""
    given = os.environ.get("SPNAV_SOCKET")
    if given:
        return given
    with contextlib.suppress(OSError, UnicodeDecodeError):
        for line in Path(SETTINGS).read_text().splitlines():
            key, _, value = line.partition("#")[0].partition("=")
            if key.strip() == "socket" and value.strip():
                return value.strip()
    return SOCKET
