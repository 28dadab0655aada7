"""Haptic device Haply Inverse3, used through the websocket of its service."""

from __future__ import annotations

import asyncio
import threading
import time
from typing import Literal

from pydantic import Field

from custom_ros_tools.errors import MissingDependency
from custom_ros_tools.schema import Positive, PositiveMetres, Text, Vec3
from operator_node.device import DeviceError
from operator_node.haptics.device import HapticConfig, HapticDevice, HapticReading, ReadingError
from robot_model.geometry import ZERO, Vector, minus, norm

from .haply_json import command_of, device_in, state_in

try:
    from websockets.exceptions import WebSocketException
    from websockets.legacy.client import connect
except ImportError as error:
    raise MissingDependency("websockets", "apt-get install python3-websockets") from error

PATIENCE_S = 1.0
"""Time without an answer after which the connection counts as lost [s]."""
PERIOD_S = 0.001
MAX_FRAME_BYTES = 1 << 18
MAX_UNFELT = 50
"""Number of consecutive forces without effect after which the other key for forces is tried."""
FELT_N = 0.3
"""Smallest sent force that is compared with the reported force [N]."""
KEYS = ("vector", "values")


class HaplyConfig(HapticConfig):
    """Options of a Haply Inverse3."""

    max_force_n: Positive = Field(8.0, description="Largest force that is sent to the device [N].")
    workspace_m: PositiveMetres = Field(0.1, description="Radius of the device's workspace.")
    url: Text = Field(
        "ws://localhost:10001", description="Websocket of Haply's service; versions before 3.1 use port 10000."
    )
    device_id: str = Field(
        "", description="Id of the Inverse3 if several are connected. If empty, the first one is used."
    )
    centre: Vec3 = Field((0.0, 0.0, 0.0), description="Middle of the workspace in the device's own axes [m].")
    force_key: Literal["auto", "vector", "values"] = Field(
        "auto", description="Key of the force in messages to the service; `auto` finds out which key has an effect."
    )


class HaplyDevice(HapticDevice):
    """Haply Inverse3. A separate thread exchanges forces and states with the device's service at 1 kHz."""

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
            DeviceError: If the service does not answer, or has no Inverse3.
        """
        self._closing, self._opened = threading.Event(), threading.Event()
        self._trouble = ""
        self._frame: str | bytes | None = None
        self._command = (ZERO, 0.0)
        self._thread = threading.Thread(target=self._run, name="haply", daemon=True)
        self._thread.start()
        self._opened.wait(3.0 * PATIENCE_S)
        self._came_s = time.monotonic()
        if self._trouble or not self._opened.is_set():
            self.close()
            raise DeviceError("haply", self._trouble or f"{self.config.url} does not answer")

    def read(self) -> HapticReading | None:
        """Returns the newest state; None if no new state has arrived since the last call.

        Raises:
            DeviceError: If the connection to the service is lost, or the service accepts no forces any more.
            ReadingError: If the state is invalid.
        """
        frame, self._frame = self._frame, None
        if frame is None:
            if self._trouble:
                raise DeviceError("haply", self._trouble)
            if time.monotonic() - self._came_s > 2.0 * PATIENCE_S:  # the service reads nothing, and sending blocks
                raise DeviceError("haply", f"{self.config.url}: it accepts no forces any more")
            return None
        self._came_s = time.monotonic()
        state = state_in(frame, self._device_id)
        force, _ = self._sent
        if not self.force_key.judge(force, state.force):
            self.count("force not taken")
        x, y, z = minus(state.position, self.config.centre)
        vx, vy, vz = state.velocity
        qx, qy, qz, qw = state.quat_xyzw
        return HapticReading((y, -x, z), (vy, -vx, vz), (qy, -qx, qz, qw), state.buttons)

    def send(self, force: Vector, expires_s: float) -> None:
        """Passes a force to the thread, which sends the force repeatedly until the force expires."""
        self._command = force, expires_s

    def close(self) -> None:
        """Sends zero force and closes the connection."""
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
        except Exception as error:  # any failure must reach `read`; otherwise it would be lost in this thread
            self._trouble = f"{self.config.url}: {type(error).__name__}: {error}"
        finally:
            self._trouble = self._trouble or "closed"
            self._opened.set()

    async def _converse(self) -> None:
        """Exchanges forces and states until the device is closed."""
        async with connect(
            self.config.url, open_timeout=PATIENCE_S, ping_interval=None, close_timeout=0.1, max_size=MAX_FRAME_BYTES
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
    """Determines the JSON key under which the service accepts a force: `vector` or `values`.

    The service's documentation uses `vector`; the service's examples use `values`.

    Args:
        key: `vector`, `values`, or `auto` to choose the key from the forces that the service reports back.

    Attributes:
        key: The key in use.
    """

    def __init__(self, key: str) -> None:
        self._may_change = key == "auto"
        self.key = KEYS[0] if key == "auto" else key
        self._unfelt = 0

    def judge(self, sent: Vector, reported: Vector) -> bool:
        """Compares a sent force with the reported force [N]. Returns False if forces seem to have no effect."""
        if norm(sent) < FELT_N:
            return True
        if norm(reported) > 0.1 * norm(sent):
            self._unfelt, self._may_change = 0, False
            return True
        self._unfelt += 1
        if self._unfelt < MAX_UNFELT:
            return True
        self._unfelt = 0
        if self._may_change:
            self.key = KEYS[1 - KEYS.index(self.key)]
        return False
