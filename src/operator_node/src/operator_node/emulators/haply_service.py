"""Emulates the service of a Haply Inverse3, with a hand on the device. Messages and port equal the real service's."""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import json
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

from websockets.exceptions import ConnectionClosed
from websockets.legacy.server import serve

from operator_node.haptics.emulated import Hand, PressMotion
from robot_model.geometry import ZERO, Vector, plus

DEVICE_ID = "04BA"
CONTINUED_S = 0.02
"""Longest time for which a force acts if no further message arrives [s]."""
STEP_S = 0.001
PATIENCE_S = 20.0
"""Longest time to wait for the start and the end of the server [s]."""


class HaplyEmulator:
    """Sends a full state to each new client, and one state in answer to each message of a client.

    A force acts until the next message, for at most `CONTINUED_S`.

    Args:
        goal: Function of time [s] that returns the position to which the hand pulls the handle [m], in the device's
            axes: x right, y forward, z up.
        key: JSON key of forces. Forces under other keys are ignored.
        port: Port to listen at; 0 selects a free port.
        mangle: Function that modifies each sent message, to test clients.

    Attributes:
        port: Port in use.
        force: Force on the hand now [N].
        hand: The simulated hand.
    """

    def __init__(
        self,
        goal: Callable[[float], Vector],
        key: str = "vector",
        port: int = 0,
        mangle: Callable[[str], str | bytes] = lambda text: text,
    ) -> None:
        self.hand, self.force, self.port = Hand(), ZERO, port
        self._goal, self._key, self._mangle = goal, key, mangle
        self._start_s = self._now_s = time.monotonic()
        self._felt_until_s = 0.0
        self._loop: asyncio.AbstractEventLoop | None = None

    def start(self) -> None:
        """Serves in a separate thread until `stop` is called. Returns when clients can connect.

        Raises:
            OSError: If the port is not available, for instance because another program uses it.
        """
        ready: Future[None] = Future()

        def serve() -> None:
            try:
                asyncio.run(self.serve(lambda: ready.set_result(None)))
            except OSError as error:
                ready.set_exception(error)

        self._thread = threading.Thread(target=serve, daemon=True)
        self._thread.start()
        ready.result(PATIENCE_S)

    def stop(self) -> None:
        """Closes all connections and stops serving."""
        if self._loop is not None:
            self._loop.call_soon_threadsafe(self._ended.set)
            self._thread.join(PATIENCE_S)
            self._loop = None

    async def serve(self, ready: Callable[[], None] = lambda: None) -> None:
        """Serves until `stop` is called. Calls `ready` when clients can connect."""
        self._ended = asyncio.Event()
        self._loop = asyncio.get_running_loop()
        async with serve(self._serve, "localhost", self.port, ping_interval=None, close_timeout=0.1) as server:
            self.port = next(iter(server.sockets)).getsockname()[1]
            ready()
            await self._ended.wait()

    async def _serve(self, connection: Any, path: str = "") -> None:
        with contextlib.suppress(ConnectionClosed):
            await connection.send(self._mangle(json.dumps(self._message(full=True))))
            async for message in connection:
                self._obey(message)
                await connection.send(self._mangle(json.dumps(self._message())))
        self.force = ZERO

    def _obey(self, message: str | bytes) -> None:
        """Simulates the time since the last message. Then applies the sum of the forces in `message`."""
        self._pass_time()
        force = ZERO
        for device in json.loads(message).get("inverse3", []):
            if device.get("device_id") == DEVICE_ID:
                vector = device.get("commands", {}).get("set_cursor_force", {}).get(self._key, {})
                force = plus(force, (vector.get("x", 0.0), vector.get("y", 0.0), vector.get("z", 0.0)))
        self.force, self._felt_until_s = force, time.monotonic() + CONTINUED_S

    def _pass_time(self) -> None:
        now_s = time.monotonic()
        self._now_s = max(self._now_s, now_s - 0.1)
        while self._now_s < now_s:
            step_s = min(STEP_S, now_s - self._now_s)
            force = self.force if self._now_s < self._felt_until_s else ZERO
            self._now_s += step_s
            self.hand.step(self._goal(self._now_s - self._start_s), force, step_s)

    def _message(self, full: bool = False) -> dict[str, Any]:
        inverse3 = {
            "device_id": DEVICE_ID,
            "state": {
                "angular_position": {"a0": 0.0, "a1": 0.0, "a2": 0.0},
                "angular_velocity": {"a0": 0.0, "a1": 0.0, "a2": 0.0},
                "body_orientation": {"w": 1.0, "x": 0.0, "y": 0.0, "z": 0.0},
                "control_mode": "cursor_force",
                "current_cursor_force": _named(self.force),
                "cursor_position": _named(self.hand.position),
                "cursor_velocity": _named(self.hand.velocity),
            },
            "status": {"calibrated": True, "in_use": True, "power_supply": True, "ready": True, "started": True},
        }
        grip = {
            "device_id": "61B9",
            "state": {"button": False, "hall": 0, "orientation": {"w": 1.0, "x": 0.0, "y": 0.0, "z": 0.0}},
        }
        if not full:
            return {"inverse3": [inverse3], "verse_grip": [grip], "wireless_verse_grip": []}
        inverse3["config"] = {
            "type": "inverse3",
            "handedness": "right",
            "gravity_compensation": {"enable": True, "gravity_scaling_factor": 1.0},
            "filters": {"force_gate": {"gain": 0.3}, "damping": {}},
        }
        return {"session_id": 1, "inverse3": [inverse3], "verse_grip": [grip], "wireless_verse_grip": []}


def _named(vector: Vector) -> dict[str, float]:
    return dict(zip("xyz", vector))


def main() -> None:
    """Runs the emulator until Ctrl-C. The hand presses down again and again."""
    parser = argparse.ArgumentParser(description="Emulates the service of a Haply Inverse3 with a hand on it.")
    parser.add_argument("--port", type=int, default=10001, help="port to listen at (10001)")
    parser.add_argument("--key", default="vector", choices=("vector", "values"), help="key of forces (vector)")
    parser.add_argument("--depth", type=float, default=0.04, help="depth of the press [m] (0.04)")
    arguments = parser.parse_args()
    press = PressMotion(arguments.depth)
    emulator = HaplyEmulator(lambda time_s: press.goal(time_s % press.duration_s), arguments.key, arguments.port)
    asyncio.run(emulator.serve(lambda: print(f"ws://localhost:{emulator.port}", flush=True)))
