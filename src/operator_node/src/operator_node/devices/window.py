"""A small window through which a device receives input."""

import contextlib
import gc
import math
import tkinter
from typing import Any

from operator_node.device import DeviceClosedError, DeviceError

BACKGROUND, INK = "#fafafa", "#202020"


class DeviceWindow:
    """A window with a drawing area.

    Args:
        device: Name of the device in messages.
        title: Title of the window.
        width: Initial width of the drawing area [px].
        height: Initial height of the drawing area [px].

    Attributes:
        canvas: Drawing area, which fills the window.

    Raises:
        DeviceError: If there is no display.
    """

    def __init__(self, device: str, title: str, width: int, height: int) -> None:
        self._device, self._is_closed = device, False
        try:
            self._root = tkinter.Tk()
        except tkinter.TclError as error:
            raise DeviceError(device, f"there is no display for its window: {error}; set DISPLAY") from None
        self._root.title(title)
        self._root.protocol("WM_DELETE_WINDOW", self._note_closed)
        self.canvas = tkinter.Canvas(self._root, width=width, height=height, background=BACKGROUND)
        self.canvas.configure(highlightthickness=0)
        self.canvas.pack(fill="both", expand=True)

    def bind(self, sequence: str, callback: Any) -> None:
        """Calls a function for each event with the tkinter name `sequence`, anywhere in the window."""
        self._root.bind(sequence, callback)

    def show(self) -> None:
        """Shows the window at once. Does not process events of the user."""
        self._root.update_idletasks()

    def focus(self) -> None:
        """Requests the keyboard focus."""
        self._root.focus_force()

    def wait(self, timeout_s: float) -> None:
        """Processes the queued events. If no events are queued, waits for the next event and processes it.

        Args:
            timeout_s: Longest time to wait for an event [s]; 0 does not wait.

        Raises:
            DeviceClosedError: If the user has closed the window.
            DeviceError: If the window was destroyed for another reason.
        """
        # Raised here because a stored error must not keep a stack frame that references the interpreter, see `close`
        failure = self._failure_of_waiting(timeout_s)
        if failure:
            raise DeviceError(self._device, f"its window has gone: {failure}")
        if self._is_closed:
            raise DeviceClosedError(self._device, "its window was closed")

    def _failure_of_waiting(self, timeout_s: float) -> str:
        """Processes events as `wait` does. Returns the reason for a failure, or an empty text."""
        interpreter = self._root.tk
        try:
            is_over: list[bool] = []
            if timeout_s > 0.0 and not interpreter.dooneevent(tkinter._tkinter.DONT_WAIT):  # type: ignore[attr-defined]
                timer = self._root.after(max(1, math.ceil(1e3 * timeout_s)), is_over.append, True)
                interpreter.dooneevent(0)
                if not is_over:
                    self._root.after_cancel(timer)
            while interpreter.dooneevent(tkinter._tkinter.DONT_WAIT):  # type: ignore[attr-defined]
                pass
        except tkinter.TclError as error:
            return str(error) or "no reason was given"
        return ""

    def close(self) -> None:
        """Closes the window; must not be called again."""
        with contextlib.suppress(tkinter.TclError):  # the window is destroyed already
            self._root.destroy()
        del self._root, self.canvas
        gc.collect()  # Tcl aborts the process if another thread frees its objects

    def _note_closed(self) -> None:
        self._is_closed = True
