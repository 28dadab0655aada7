"""Haply Inverse3, by the websocket of its service."""

from __future__ import annotations

import asyncio
import json
import threading
import time
from typing import Any, Literal, NamedTuple

from pydantic import Field

from custom_ros_tools.errors import MissingDependency
from custom_ros_tools.schema import Positive, PositiveMetres, Text, Vec3
from operator_node.device import DeviceError
from operator_node.haptics.device import HapticConfig, HapticDevice, HapticReading, ReadingError
from operator_node.haptics.vectors import ZERO, norm
from rpbi.geometry import Quaternion, Vector, minus

try:
    from websockets.exceptions import WebSocketException
    from websockets.legacy.client import connect
except ImportError as error:
    raise MissingDependency("websockets", "apt-get install python3-websockets") from error

PATIENCE_S = 1.0
"""After so long without an answer the connection counts as lost [s]."""
PERIOD_S = 0.001
LONGEST_FRAME = 1 << 18
TRIED = 50
"""So many forces in a row that are not felt mean that the service knows another key."""
FELT_N = 0.3
"""Forces below this tell nothing about the key [N]."""
KEYS = ("vector", "values")


class HaplyConfig(HapticConfig):
    """A Haply Inverse3."""

    max_force_n: Positive = Field(8.0, description="The largest force that it is sent [N].")
    workspace_m: PositiveMetres = Field(0.1, description="Radius of its workspace.")
    url: Text = Field("ws://localhost:10001", description="The service's websocket; port 10000 before 3.1.")
    device_id: str = Field("", description="Which Inverse3, if there are several; empty takes the first one.")
    centre: Vec3 = Field((0.0, 0.0, 0.0), description="Middle of the workspace in the device's own axes [m].")
    force_key: Literal["auto", "vector", "values"] = Field(
        "auto", description="What the service calls a force; auto tries which one it reports back."
    )


class HaplyDevice(HapticDevice):
    """Speaks with the service in a thread of its own, at 1 kHz: one force there, one state back."""

    Config = HaplyConfig
    config: HaplyConfig

    def __init__(self, config: HaplyConfig) -> None:
        super().__init__(config)
        self._thread: threading.Thread | None = None
        self._command: tuple[Vector, float] = (ZERO, 0.0)
        self.force_key = ForceKey(config.force_key)

    def open(self) -> None:
        """Connects to the service.

        Raises:
            DeviceError: If it does not answer, or has no Inverse3.
        """
        self._closing, self._opened = threading.Event(), threading.Event()
        self._trouble = ""
        self._frame: str | bytes | None = None
        self._command = (ZERO, 0.0)
        self._thread = threading.Thread(target=self._run, name="haply", daemon=True)
        self._thread.start()
        self._opened.wait(3.0 * PATIENCE_S)
        if self._trouble or not self._opened.is_set():
            self.close()
            raise DeviceError("haply", self._trouble or f"{self.config.url} does not answer")

    def read(self) -> HapticReading | None:
        """Returns the newest state.

        Raises:
            DeviceError: If the service has gone.
            ReadingError: If the state makes no sense.
        """
        frame, self._frame = self._frame, None
        if frame is None:
            if self._trouble:
                raise DeviceError("haply", self._trouble)
            return None
        state = state_in(frame, self._device_id)
        force, _ = self._sent
        if not self.force_key.judge(force, state.force):
            self.count("force not taken")
        x, y, z = minus(state.position, self.config.centre)
        vx, vy, vz = state.velocity
        qx, qy, qz, qw = state.quat_xyzw
        return HapticReading((y, -x, z), (vy, -vx, vz), (qy, -qx, qz, qw), state.buttons)

    def send(self, force: Vector, expires_s: float) -> None:
        """Has the thread send a force until it expires."""
        self._command = force, expires_s

    def close(self) -> None:
        """Sends zero force and hangs up."""
        if self._thread is not None:
            self._closing.set()
            self._thread.join(2.0 * PATIENCE_S)
            self._thread = None

    def _run(self) -> None:
        try:
            asyncio.run(self._converse())
        except (TimeoutError, OSError, WebSocketException) as error:
            self._trouble = f"{self.config.url}: {error or 'does not answer'}"
        except ReadingError as error:
            self._trouble = f"{self.config.url}: {error}"
        finally:
            self._trouble = self._trouble or "closed"
            self._opened.set()

    async def _converse(self) -> None:
        """Exchanges forces and states until the device is closed."""
        async with connect(
            self.config.url, open_timeout=PATIENCE_S, ping_interval=None, close_timeout=0.1, max_size=LONGEST_FRAME
        ) as connection:
            first = await asyncio.wait_for(connection.recv(), PATIENCE_S)
            self._device_id = device_in(first, self.config.device_id)
            self._sent = self._command
            self._opened.set()
            due_s = time.monotonic()
            while not self._closing.is_set():
                force, expires_s = self._sent = self._command
                if time.monotonic() >= expires_s:
                    force = ZERO
                    self._sent = ZERO, expires_s
                await connection.send(command_of(self._device_id, force, self.force_key.key))
                self._frame = await asyncio.wait_for(connection.recv(), PATIENCE_S)
                due_s = max(due_s + PERIOD_S, time.monotonic())
                # Nothing else runs in this thread, and asyncio's own timers are too coarse
                time.sleep(max(due_s - time.monotonic(), 0.0))
            await connection.send(command_of(self._device_id, ZERO, self.force_key.key))


class ForceKey:
    """Which key of a force the service takes: its documentation has `vector`, its examples `values`.

    Args:
        key: One of them, or `auto` to find out by what the service reports back.

    Attributes:
        key: The one in use.
    """

    def __init__(self, key: str) -> None:
        self._may_change = key == "auto"
        self.key = KEYS[0] if key == "auto" else key
        self._unfelt = 0

    def judge(self, sent: Vector, reported: Vector) -> bool:
        """Takes a force that was sent and one that was reported [N]; returns False when it seems to have no effect."""
        if norm(sent) < FELT_N:
            return True
        if norm(reported) > 0.1 * norm(sent):
            self._unfelt, self._may_change = 0, False
            return True
        self._unfelt += 1
        if self._unfelt < TRIED:
            return True
        self._unfelt = 0
        if self._may_change:
            self.key = KEYS[1 - KEYS.index(self.key)]
        return False


class HaplyState(NamedTuple):
    """What the service says, in the device's own axes: x right, y forward, z up.

    Attributes:
        position: Of the cursor [m].
        velocity: Of the cursor [m/s].
        quat_xyzw: Orientation of the grip, none without one.
        buttons: Those of the grip.
        force: What the device pushes with [N].
    """

    position: Vector
    velocity: Vector
    quat_xyzw: Quaternion
    buttons: tuple[int, ...]
    force: Vector


def command_of(device_id: str, force: Vector, key: str) -> str:
    """Returns the message that sends a force, in the axes of `HapticReading` [N]."""
    x, y, z = -force[1], force[0], force[2]
    commands = {"set_cursor_force": {key: {"x": x, "y": y, "z": z}}}
    return json.dumps({"inverse3": [{"device_id": device_id, "commands": commands}]})


def device_in(frame: str | bytes, wanted: str) -> str:
    """Returns the id of an Inverse3 that the first message names.

    Raises:
        ReadingError: If it names none, or not the one that is wanted.
    """
    known = [str(each.get("device_id", "")) for each in _entries(_message(frame), "inverse3")]
    if not known or (wanted and wanted not in known):
        names = f"it has {', '.join(known)}" if known else "it has none"
        raise ReadingError("no device", f"expected an Inverse3{wanted and f' {wanted}'}, {names}")
    return wanted or known[0]


def state_in(frame: str | bytes, device_id: str) -> HaplyState:
    """Returns the state of an Inverse3, and of the first grip, in a message.

    Raises:
        ReadingError: If it is not there, or not made of finite numbers.
    """
    message = _message(frame)
    states = [each for each in _entries(message, "inverse3") if each.get("device_id") == device_id]
    if not states:
        raise ReadingError("no device", f"a message without Inverse3 {device_id}")
    state = _mapping(states[0], "state")
    quat: Quaternion = (0.0, 0.0, 0.0, 1.0)
    buttons: tuple[int, ...] = ()
    for kind in ("verse_grip", "wireless_verse_grip"):
        for grip in _entries(message, kind)[:1]:
            held = _mapping(grip, "state")
            x, y, z, w = _numbers(held, "orientation", "xyzw")
            quat = x, y, z, w
            pressed = held.get("buttons", {"a": held.get("button", False)})
            if not isinstance(pressed, dict):
                raise ReadingError("not a state", f"expected buttons by name, got {type(pressed).__name__}")
            buttons = tuple(int(bool(pressed[name])) for name in sorted(pressed))
    force = _vector(state, "current_cursor_force") if "current_cursor_force" in state else ZERO
    return HaplyState(_vector(state, "cursor_position"), _vector(state, "cursor_velocity"), quat, buttons, force)


def _message(frame: str | bytes) -> dict[str, Any]:
    try:
        message = json.loads(frame)
    except (ValueError, RecursionError) as error:
        raise ReadingError("not JSON", str(error)[:80]) from None
    if not isinstance(message, dict):
        raise ReadingError("not a state", f"expected a JSON object, got {type(message).__name__}")
    return message


def _entries(message: dict[str, Any], key: str) -> list[dict[str, Any]]:
    entries = message.get(key, [])
    if not isinstance(entries, list) or not all(isinstance(each, dict) for each in entries):
        raise ReadingError("not a state", f"expected {key} to be a list of objects")
    return entries


def _mapping(entry: dict[str, Any], key: str) -> dict[str, Any]:
    found = entry.get(key)
    if not isinstance(found, dict):
        raise ReadingError("not a state", f"expected an object {key}, got {type(found).__name__}")
    return found


def _numbers(state: dict[str, Any], key: str, names: str) -> list[float]:
    values = _mapping(state, key)
    numbers = []
    for name in names:
        value = values.get(name)
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise ReadingError("not a state", f"expected a number {key}.{name}, got {type(value).__name__}")
        if not abs(value) < 1e9:
            raise ReadingError("not finite", f"{key}.{name} is not a finite number below 1e9")
        numbers.append(float(value))
    return numbers


def _vector(state: dict[str, Any], key: str) -> Vector:
    x, y, z = _numbers(state, key, "xyz")
    return x, y, z
