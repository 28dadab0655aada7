"""`spacenavd_emulator.py`: emulates spacenavd, the daemon of 6-D mice, with a device that moves by itself."""

import argparse
import contextlib
import os
import select
import socket
import threading
import time
from collections.abc import Sequence
from pathlib import Path

from operator_node.devices.spacenav import (
    ANSWERS,
    DEVICE,
    GET_BUTTONS,
    MOTION,
    PACKET,
    PRESS,
    PROTOCOL_MASK,
    PROTOCOL_TAG,
    RELEASE,
    REQUEST,
    WORD,
    socket_path,
)

FULL = 350
"""Raw value that most devices send at the end of an axis."""
SET_NAME, SET_SENSITIVITY, SET_MASK, GET_NAME, GET_AXES = (
    REQUEST | number for number in (0x1000, 0x1001, 0x1003, 0x2000, 0x2002)
)
EVENT_BITS = {MOTION: 1, PRESS: 2, RELEASE: 2, DEVICE: 4}
MASK_AT_FIRST = {0: 3, 1: 7}
"""Bits of the events that a client receives before it selects events, keyed by the version of its protocol."""
NAME, CHUNK = b"emulated 6-D mouse", 24
CONTINUED = 0x10000
REFUSED = -1
PERIOD_S = 0.01
HOLD_S = 1.0
PATIENCE_S = 5.0
"""Time after which a client that does not read its socket is disconnected [s]."""


class SpacenavClient:
    """State of one client of the daemon."""

    def __init__(self, connection: socket.socket) -> None:
        self.socket = connection
        self.protocol, self.mask = 0, MASK_AT_FIRST[0]
        self.received = bytearray()


class SpacenavDaemon:
    """Serves an emulated 6-D mouse to any number of clients, from the construction until `close`.

    Args:
        path: Path of the daemon's socket. An existing file is replaced.
        protocol: Newest supported version of the protocol, 0 or 1.
        buttons: Number of buttons of the device.

    Attributes:
        path: Path of the daemon's socket.
    """

    def __init__(self, path: str | Path, protocol: int = 1, buttons: int = 2) -> None:
        self.path = Path(path)
        self._protocol, self._buttons = protocol, buttons
        self._is_plugged = True
        self._clients: list[SpacenavClient] = []
        self._lock = threading.RLock()
        self._wake_reader, self._wake_writer = os.pipe()
        self.path.unlink(missing_ok=True)
        self._listener = socket.socket(socket.AF_UNIX)
        self._listener.bind(str(self.path))
        self._listener.listen()
        self._thread = threading.Thread(target=self._serve, name="spacenavd", daemon=True)
        self._thread.start()

    @property
    def clients(self) -> int:
        """Number of connected clients."""
        return len(self._clients)

    def move(self, x: int, y: int, z: int, rx: int = 0, ry: int = 0, rz: int = 0) -> None:
        """Sends raw displacements (x right, y up, z away from the user) and raw rotations of the mouse's cap."""
        self._broadcast(MOTION, x, y, z, rx, ry, rz, 0)

    def press(self, button: int, is_down: bool = True) -> None:
        """Presses or releases a button."""
        self._broadcast(PRESS if is_down else RELEASE, button, int(is_down))

    def unplug(self) -> None:
        """Emulates that the device is unplugged."""
        self._is_plugged = False
        self._broadcast(DEVICE, 1, 0)

    def plug(self) -> None:
        """Emulates that the device is plugged in again."""
        self._is_plugged = True
        self._broadcast(DEVICE, 0, 0)

    def send(self, data: bytes) -> None:
        """Sends raw data to all clients."""
        with self._lock:
            for client in [*self._clients]:
                self._send(client, data)

    def close(self) -> None:
        """Closes all connections, and removes the socket."""
        os.write(self._wake_writer, b".")
        self._thread.join(2.0 * PATIENCE_S)
        for client in self._clients:
            client.socket.close()
        self._listener.close()
        os.close(self._wake_reader)
        os.close(self._wake_writer)
        self.path.unlink(missing_ok=True)

    def _serve(self) -> None:
        while True:
            clients = {client.socket.fileno(): client for client in self._clients}
            ready, _, _ = select.select([self._wake_reader, self._listener.fileno(), *clients], [], [])
            if self._wake_reader in ready:
                return
            for number in ready:
                with self._lock:
                    if number in clients:
                        self._receive(clients[number])
                    else:
                        connection = self._listener.accept()[0]
                        connection.settimeout(PATIENCE_S)
                        self._clients.append(SpacenavClient(connection))

    def _receive(self, client: SpacenavClient) -> None:
        received = b""
        with contextlib.suppress(OSError):
            received = client.socket.recv(4096)
        if not received:
            client.socket.close()
            self._clients.remove(client)
            return
        client.received += received
        while self._answer(client):
            pass

    def _answer(self, client: SpacenavClient) -> bool:
        """Processes the next complete request of a client. Returns whether there was a complete request."""
        if client.protocol == 1:
            if len(client.received) < PACKET.size:
                return False
            request = PACKET.unpack_from(client.received)
            del client.received[: PACKET.size]
            self._answer_request(client, request)
            return True
        if len(client.received) < WORD.size:
            return False
        (word,) = WORD.unpack_from(client.received)
        del client.received[: WORD.size]
        if self._protocol == 1 and word & PROTOCOL_MASK == PROTOCOL_TAG:  # otherwise the word is a sensitivity
            client.protocol = min(word & 0xFF, self._protocol)
            client.mask = MASK_AT_FIRST[client.protocol]
            self._send(client, WORD.pack(PROTOCOL_TAG | client.protocol))
        return True

    def _answer_request(self, client: SpacenavClient, request: Sequence[int]) -> None:
        kind = request[0]
        if kind not in ANSWERS:
            return
        if kind == SET_MASK:
            client.mask = request[1]
        elif kind == GET_NAME and self._is_plugged:
            for start in range(0, len(NAME), CHUNK):
                chunk = NAME[start : start + CHUNK].ljust(CHUNK, b"\0")
                length = (len(NAME) - start) | (CONTINUED if start else 0)
                self._send(client, WORD.pack(kind) + chunk + WORD.pack(length))
            return
        has_device = self._is_plugged or kind in (SET_NAME, SET_SENSITIVITY, SET_MASK)
        value = {GET_BUTTONS: self._buttons, GET_AXES: 6}.get(kind, request[1])
        self._send(client, PACKET.pack(kind, value, *[0] * 5, 0 if has_device else REFUSED))

    def _broadcast(self, kind: int, *values: int) -> None:
        packet = PACKET.pack(kind, *values, *[0] * (7 - len(values)))
        with self._lock:
            for client in [*self._clients]:
                if client.mask & EVENT_BITS[kind]:
                    self._send(client, packet)

    def _send(self, client: SpacenavClient, data: bytes) -> None:
        try:
            client.socket.sendall(data)
        except OSError:
            self._drop(client)

    def _drop(self, client: SpacenavClient) -> None:
        """Shuts a connection down. The serving thread, which may be waiting for the client, closes the socket later."""
        with contextlib.suppress(OSError):
            client.socket.shutdown(socket.SHUT_RDWR)


def main() -> None:
    """Runs the daemon until Ctrl-C. The mouse's cap moves along each axis in turn, back and forth."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--socket", default=socket_path(), help="path of the socket; by default where clients expect it"
    )
    parser.add_argument("--protocol", type=int, choices=(0, 1), default=1, help="newest supported version")
    arguments = parser.parse_args()
    daemon = SpacenavDaemon(arguments.socket, arguments.protocol)
    print(f"serves a 6-D mouse at {daemon.path}, which moves along each axis in turn, until Ctrl-C", flush=True)
    try:
        while True:
            for axis in range(6):
                for value in (FULL, 0, -FULL, 0):
                    _hold(daemon, [value if each == axis else 0 for each in range(6)])
    finally:
        daemon.close()


def _hold(daemon: SpacenavDaemon, motion: Sequence[int]) -> None:
    """Sends the same motion for `HOLD_S`, like a hand that holds the cap."""
    end_s = time.monotonic() + HOLD_S
    while time.monotonic() < end_s:
        daemon.move(*motion)
        time.sleep(PERIOD_S)
