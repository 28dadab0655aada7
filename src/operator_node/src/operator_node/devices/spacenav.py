"""Input device 6-D mouse, read from spacenavd or from another daemon with the same protocol."""

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
"""Bits that mark the type of a packet as a request or an answer."""
PROTOCOL_TAG = REQUEST | 0x5500
PROTOCOL_MASK = 0x7FFFFF00
"""Mask of all bits except the version in the word with which the protocol version is negotiated."""
SENSITIVITY = struct.pack("=f", 1.0)
MOTION, PRESS, RELEASE, DEVICE, LAST_EVENT = 0, 1, 2, 3, 6
"""Types of packets; all types from 0 to LAST_EVENT are events."""
GET_BUTTONS = REQUEST | 0x2003
ANSWERS = range(REQUEST | 0x1000, REQUEST | 0x4000)
ANSWER_TIMEOUT_S = 0.3
MAX_VALUE = 32767
"""Largest raw value that a 6-D mouse reports; larger values are refused."""
MAX_BUTTONS = 64
MAX_REFUSED = 8
"""Number of consecutive invalid packets after which the protocol counts as unknown."""
POLL_S = 0.001
"""Time that corresponds to one unit of `static_count_threshold` [s]."""

Scale = Annotated[float | Vec3, Field()]


class SpacenavConfig(ConfigModel):
    """Connection and scaling of a 6-D mouse; all parameters except `socket` are named as in ROS's `spacenav_node`."""

    socket: Text | None = optional(
        f"Socket of the daemon. Default: `$SPNAV_SOCKET`, otherwise the socket in `{SETTINGS}`, otherwise `{SOCKET}`."
    )
    full_scale: Positive = Field(512.0, description="Raw value of the device at which an axis is 1.")
    linear_scale: Scale = Field(
        1.0, description="Factor of `spacenav/offset` and of the linear velocity: one number, or one for each axis."
    )
    angular_scale: Scale = Field(
        1.0,
        description="Factor of `spacenav/rot_offset` and of the angular velocity: one number, or one for each axis.",
    )
    zero_when_static: Switch = Field(
        True, description="Whether all axes become 0 after `static_count_threshold` without events."
    )
    static_count_threshold: Count = Field(30, description="Time without events after which axes become 0 [ms].")
    static_trans_deadband: NonNegative = Field(
        0.1,
        description="Without `zero_when_static`, x, y and z become 0 after `static_count_threshold` without events "
        "if all three magnitudes are below this value.",
    )
    static_rot_deadband: NonNegative = Field(
        0.1,
        description="Without `zero_when_static`, the three rotations become 0 after `static_count_threshold` without "
        "events if all three magnitudes are below this value.",
    )


class Spacenav(Device):
    """A 6-D mouse, read from the daemon spacenavd.

    The axes are the translations along x (forward), y (left) and z (up), followed by the rotations about x, y and z,
    each divided by `full_scale`.
    """

    Config = SpacenavConfig
    axes = ("x", "y", "z", "rx", "ry", "rz")
    ros_topics = "operator_node.devices.device_topics:SpacenavTopics"

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
        self._reset()
        path = self.config.socket or socket_path()
        self._socket = connection = socket.socket(socket.AF_UNIX)
        connection.settimeout(ANSWER_TIMEOUT_S)
        try:
            connection.connect(path)
            protocol = self._negotiate()
        except OSError as error:
            self.close()
            raise DeviceError("spacenav", f"no spacenavd at {path}: {error.strerror or error}") from None
        if protocol == 0:
            self._send(SENSITIVITY)
            return
        buttons = self._request(GET_BUTTONS)
        if buttons is None:
            self.close()
            raise DeviceError("spacenav", "spacenavd has no device: is it plugged in?")
        self._extend_buttons(buttons)

    def read(self, timeout_s: float) -> Reading | None:
        if self._socket is None:
            raise DeviceError("spacenav", "it is not open")
        if self._refused_in_a_row >= MAX_REFUSED:
            raise DeviceError("spacenav", "the data received are not spacenavd's protocol")
        if not self._packets():
            self._receive(max(0.0, min(timeout_s, self._static_at_s - time.monotonic())))
        for packet in self._packets():
            self._process(packet)
            if packet[0] in (PRESS, RELEASE) or self._refused_in_a_row >= MAX_REFUSED:
                break
        if time.monotonic() >= self._static_at_s:
            self._zero_static_axes()
        if not self._is_new and not self._refused:
            return None
        reading = Reading(self._motion, tuple(self._pressed), refused=tuple(self._refused))
        self._is_new, self._refused = False, []
        return reading

    def close(self) -> None:
        if self._socket is not None:
            self._socket.close()
        self._socket = None

    def _reset(self) -> None:
        self._received.clear()
        self._motion = (0.0,) * 6
        self._pressed = [0] * len(self.buttons)
        self._refused = []
        self._refused_in_a_row = 0
        self._is_new = False
        self._static_at_s = time.monotonic() + POLL_S * self.config.static_count_threshold

    # --- The connection.

    def _negotiate(self) -> int:
        """Requests version 1 of the protocol. Returns the version in use, or 0 if the daemon does not answer."""
        self._send(WORD.pack(PROTOCOL_TAG | 1))
        end_s = time.monotonic() + ANSWER_TIMEOUT_S
        while len(self._received) < WORD.size:
            left_s = end_s - time.monotonic()
            if left_s <= 0.0 or not self._receive(left_s):
                return 0
        (answer,) = WORD.unpack_from(self._received)
        if answer & PROTOCOL_MASK != PROTOCOL_TAG:
            return 0  # the start of an event
        del self._received[: WORD.size]
        return 1

    def _request(self, request: int) -> int | None:
        """Sends a request and returns the first number of the answer, or None if the daemon rejected the request.

        Events that arrive before the answer are processed.

        Raises:
            DeviceError: If the daemon does not answer in time, or has disconnected.
        """
        self._send(PACKET.pack(request, *[0] * 7))
        end_s = time.monotonic() + ANSWER_TIMEOUT_S
        while time.monotonic() < end_s:
            for packet in self._packets():
                if packet[0] == request:
                    return packet[1] if packet[7] == 0 else None
                self._process(packet)
            self._receive(max(0.0, end_s - time.monotonic()))
        raise DeviceError("spacenav", "spacenavd does not answer")

    def _send(self, data: bytes) -> None:
        assert self._socket is not None
        try:
            self._socket.sendall(data)
        except OSError as error:
            raise DeviceError("spacenav", f"spacenavd has gone: {error.strerror or error}") from None

    def _receive(self, timeout_s: float) -> bool:
        """Waits for bytes and appends them to the receive buffer. Returns whether bytes arrived."""
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

    # --- The packets.

    def _process(self, packet: Sequence[int]) -> None:
        reason = self._problem_of(packet)
        if reason is not None:
            self._refused.append(reason)
            self._refused_in_a_row += 1
            return
        self._refused_in_a_row = 0
        kind = packet[0]
        if kind == MOTION:
            if max(map(abs, packet[1:7])) > self.config.full_scale:
                self._refused.append("a motion beyond full_scale, which is cut off there")
            x, y, z, rx, ry, rz = (max(-1.0, min(1.0, each / self.config.full_scale)) for each in packet[1:7])
            self._motion = (z, -x + 0.0, y, rz, -rx + 0.0, ry)
            self._static_at_s = time.monotonic() + POLL_S * self.config.static_count_threshold
            self._is_new = True
        elif kind in (PRESS, RELEASE):
            self._extend_buttons(packet[1] + 1)
            self._pressed[packet[1]] = int(kind == PRESS)
            self._is_new = True
        elif kind == DEVICE and packet[1] == 1:
            raise DeviceError("spacenav", "it was unplugged")

    def _problem_of(self, packet: Sequence[int]) -> str | None:
        kind = packet[0]
        if kind == MOTION and not all(-MAX_VALUE <= each <= MAX_VALUE for each in packet[1:7]):
            return f"a motion beyond {MAX_VALUE}"
        if kind in (PRESS, RELEASE) and not 0 <= packet[1] < MAX_BUTTONS:
            return f"a button outside 0 to {MAX_BUTTONS - 1}"
        if not (0 <= kind <= LAST_EVENT or kind in ANSWERS):
            return "a packet of an unknown type"
        return None

    def _extend_buttons(self, count: int) -> None:
        """Adds buttons until there are `count`, but at most `MAX_BUTTONS`.

        For some devices, the first event of a button is the only sign that the button exists.
        """
        missing = min(count, MAX_BUTTONS) - len(self._pressed)
        if missing > 0:
            self._pressed += [0] * missing
            self.buttons = [*map(str, range(len(self._pressed)))]

    def _zero_static_axes(self) -> None:
        """Sets the axes to 0 after the configured time without motion events."""
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
    """Iterates over the complete packets in a receive buffer, removing each packet from the buffer."""

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
    """Returns the path of the daemon's socket, determined in the same way as in libspnav."""
    given = os.environ.get("SPNAV_SOCKET")
    if given:
        return given
    with contextlib.suppress(OSError, UnicodeDecodeError):
        for line in Path(SETTINGS).read_text().splitlines():
            key, _, value = line.partition("#")[0].partition("=")
            if key.strip() == "socket" and value.strip():
                return value.strip()
    return SOCKET
