"""A haptic device without hardware: the mouse moves a handle in a window, and an arrow shows the force."""

import math
import os
import socket
import struct
import subprocess
import sys
import time

from pydantic import Field

from custom_ros_tools.schema import NonNegative, Positive, PositiveMetres, Switch
from operator_node.device import DeviceError
from operator_node.haptics.device import DeviceEnded, HapticConfig, HapticReading
from operator_node.haptics.emulated import EmulatedDevice
from robot_model.geometry import ZERO, Vector, shortened_to

FROM_WINDOW = struct.Struct("=4d")
"""Message from the window: position x, y, z of the mouse [m], and 1 if the button is held, otherwise 0."""
TO_WINDOW = struct.Struct("=6d")
"""Message to the window: position of the handle [m] and force [N]."""
SHOW_S = 0.02
"""Period at which the window is updated [s]."""


class VirtualConfig(HapticConfig):
    """Options of the virtual device, a window in which the mouse moves a handle."""

    max_force_n: Positive = Field(10.0, description="Largest force that is sent to the device [N].")
    workspace_m: PositiveMetres = Field(0.1, description="Radius of the device's workspace.")
    resolution_m: NonNegative = Field(
        0.0, description="Resolution of each measured axis [m]; 0 means exact measurements."
    )
    returns: Switch = Field(
        False,
        description="Whether the handle returns to the middle when it is released, for commands of velocities rather "
        "than positions.",
    )


class VirtualDevice(EmulatedDevice):
    """Window in which the mouse pulls a simulated handle by a spring. No hardware is needed.

    A force deflects the handle from the mouse, and is drawn as an arrow. The window runs in a separate process, so that
    drawing does not delay the loop.
    """

    Config = VirtualConfig
    config: VirtualConfig

    def __init__(self, config: VirtualConfig) -> None:
        super().__init__(config)
        self._socket: socket.socket | None = None
        self._mouse: Vector = ZERO
        self._shown_s = 0.0

    def open(self) -> None:
        """Opens the window.

        Raises:
            DeviceError: If there is no display.
        """
        if not os.environ.get("DISPLAY"):
            raise DeviceError("virtual", "its window needs a display, and DISPLAY is not set")
        ours, theirs = socket.socketpair()
        ours.setblocking(False)
        config = self.config
        program = "operator_node.haptics.devices.virtual_window"
        options = (theirs.fileno(), config.workspace_m, config.max_force_n, int(config.returns))
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-m", program, *map(str, options)], pass_fds=(theirs.fileno(),), start_new_session=True
            )
        self._socket, self._mouse, self._received = ours, ZERO, b""
        super().open()

    def goal(self, time_s: float) -> Vector:
        """Returns the position of the mouse [m], to which the spring pulls the handle."""
        return self._mouse

    def read(self) -> HapticReading | None:
        """Reads the mouse, updates the window, and returns the state of the handle.

        Raises:
            DeviceEnded: If the window was closed.
        """
        self._listen()
        reading = super().read()
        if reading is not None and (now_s := time.monotonic()) - self._shown_s > SHOW_S:
            self._shown_s = now_s
            self._show(TO_WINDOW.pack(*reading.position, *self.force))
        return reading

    def close(self) -> None:
        """Closes the window."""
        super().close()
        if self._socket is not None:
            self._socket.close()
            self._socket = None
            try:
                self._process.wait(2.0)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()

    def _listen(self) -> None:
        if self._socket is None:
            raise DeviceError("virtual", "its window is not open")
        try:
            received = self._socket.recv(4096)
        except BlockingIOError:
            return
        except OSError:
            received = b""
        if not received:
            raise DeviceEnded("virtual", "its window was closed")
        self._received += received
        size = FROM_WINDOW.size
        whole = len(self._received) // size * size
        if whole:
            x, y, z, held = FROM_WINDOW.unpack(self._received[whole - size : whole])
            self._received = self._received[whole:]
            if math.isfinite(x + y + z):
                self._mouse = shortened_to((x, y, z), 1.5 * self.config.workspace_m)
            self.buttons = (int(held > 0.5),)

    def _show(self, message: bytes) -> None:
        assert self._socket is not None
        try:
            self._socket.send(message)
        except BlockingIOError:
            return  # the window is slow, and gets the next message
        except OSError:
            raise DeviceEnded("virtual", "its window was closed") from None
