"""Input device mouse, which is dragged in a window."""

import math
import time
from tkinter import Event, Misc

from pydantic import Field

from custom_ros_tools.schema import ConfigModel, Fraction, Seconds
from operator_node.device import Device, DeviceError, Reading

from .window import INK, DeviceWindow

SIZE_PX = 400
RADIUS_PX = 12
BUTTONS = {1: 0, 2: 1, 3: 2}
"""Maps X's number of each button to the index of the button in a reading."""
WHEEL_STEPS = {4: 1.0, 5: -1.0}
"""Maps X's button number of each direction of the wheel to the sign of the wheel's motion."""
DRAGGING = 0x100
"""Bit of an event's state that is set while the left button is held."""
HELP = "drag: x, y    wheel: z    release: stop"


class MouseConfig(ConfigModel):
    """Step width and return time of the wheel's axis."""

    wheel_step: Fraction = Field(0.25, description="Change of the wheel's axis for each notch.")
    wheel_return_s: Seconds = Field(
        0.3, description="Time after the last notch at which the wheel's axis returns to 0."
    )


class Mouse(Device):
    """A mouse that is dragged in a separate window.

    The axes `x` (to the right) and `y` (up) are the displacement from the point where the left button went down,
    divided by half the width and half the height of the window. Both axes are 0 while the left button is not held. The
    axis `wheel` is positive away from the user, and returns to 0 `wheel_return_s` after the last notch.
    """

    Config = MouseConfig
    axes = ("x", "y", "wheel")
    buttons = ("left", "middle", "right")

    def __init__(self, config: MouseConfig) -> None:
        self._config = config
        self._window: DeviceWindow | None = None
        self._origin: tuple[int, int] | None = None
        self._drag = (0.0, 0.0)
        self._held = [0, 0, 0]
        self._wheel, self._wheel_over_s = 0.0, math.inf
        self._is_new = False

    def open(self) -> None:
        self._reset()
        self._window = window = DeviceWindow("mouse", "mouse", SIZE_PX, SIZE_PX)
        window.bind("<ButtonPress>", self._press)
        window.bind("<ButtonRelease>", self._release)
        window.bind("<Motion>", self._move)
        window.bind("<Unmap>", lambda _: self._reset())
        window.bind("<Configure>", lambda _: self._draw())
        window.show()
        self._draw()

    def read(self, timeout_s: float) -> Reading | None:
        if self._window is None:
            raise DeviceError("mouse", "it is not open")
        if not self._is_new:  # otherwise the window was just opened, and the first reading must be at rest
            self._window.wait(max(0.0, min(timeout_s, self._wheel_over_s - time.monotonic())))
        if not self._is_new and time.monotonic() >= self._wheel_over_s:  # a motion of the wheel must be reported first
            self._wheel, self._wheel_over_s, self._is_new = 0.0, math.inf, True
        if not self._is_new:
            return None
        self._is_new = False
        self._draw()
        return Reading((*self._drag, self._wheel), tuple(self._held))

    def close(self) -> None:
        if self._window is not None:
            self._window.close()
        self._window = None

    def _reset(self) -> None:
        self._origin, self._drag = None, (0.0, 0.0)
        self._held = [0, 0, 0]
        self._wheel, self._wheel_over_s = 0.0, math.inf
        self._is_new = True

    def _press(self, event: "Event[Misc]") -> None:
        number = int(event.num)
        if number in WHEEL_STEPS:
            wheel = self._wheel + WHEEL_STEPS[number] * self._config.wheel_step
            self._wheel = max(-1.0, min(1.0, wheel))
            self._wheel_over_s = time.monotonic() + self._config.wheel_return_s
        elif number in BUTTONS:
            self._held[BUTTONS[number]] = 1
            if number == 1:
                self._origin = (event.x_root, event.y_root)
        self._is_new = True

    def _release(self, event: "Event[Misc]") -> None:
        number = int(event.num)
        if number in BUTTONS:
            self._held[BUTTONS[number]] = 0
            if number == 1:
                self._origin, self._drag = None, (0.0, 0.0)
            self._is_new = True

    def _move(self, event: "Event[Misc]") -> None:
        if self._origin is None or self._window is None:
            return
        if not int(event.state) & DRAGGING:  # another program, such as a screen lock, received the release
            self._reset()
            return
        half_width, half_height = self._half_size()
        x, y = event.x_root - self._origin[0], self._origin[1] - event.y_root
        self._drag = (max(-1.0, min(1.0, x / half_width)), max(-1.0, min(1.0, y / half_height)))
        self._is_new = True

    def _half_size(self) -> tuple[float, float]:
        assert self._window is not None
        canvas = self._window.canvas
        return max(canvas.winfo_width(), 2) / 2, max(canvas.winfo_height(), 2) / 2

    def _draw(self) -> None:
        """Draws the displacement as an arrow from the centre, the wheel's axis as a bar, and instructions as text."""
        if self._window is None:
            return
        canvas = self._window.canvas
        half_width, half_height = self._half_size()
        x, y = half_width * (1.0 + self._drag[0]), half_height * (1.0 - self._drag[1])
        canvas.delete("all")
        canvas.create_line(half_width, 0, half_width, 2 * half_height, fill="#d0d0d0")
        canvas.create_line(0, half_height, 2 * half_width, half_height, fill="#d0d0d0")
        canvas.create_line(half_width, half_height, x, y, width=3, arrow="last", fill="#1060c0")
        fill = "#1060c0" if self._held[0] else "#909090"
        canvas.create_oval(x - RADIUS_PX, y - RADIUS_PX, x + RADIUS_PX, y + RADIUS_PX, fill=fill, outline="")
        top = half_height * (1.0 - self._wheel)
        canvas.create_rectangle(4, min(top, half_height), 12, max(top, half_height), fill="#c06010", outline="")
        canvas.create_text(half_width, 2 * half_height - 14, text=HELP, fill=INK)
