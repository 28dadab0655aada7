"""A small window of a device."""

import contextlib
import gc
import math
import tkinter
from typing import Any

from operator_node.device import DeviceClosedError, DeviceError

BACKGROUND, INK = "#fafafa", "#202020"


class Window:
    """A window with a drawing area in it.

    Args:
        device: What the device is called in messages.
        title: Title of the window.
        width: Columns of the drawing area at first [px].
        height: Its rows at first [px].

    Attributes:
        canvas: The drawing area; it takes the whole window.

    Raises:
        DeviceError: If there is no screen.
    """

    def __init__(self, device: str, title: str, width: int, height: int) -> None:
        self._device, self._is_closed = device, False
        try:
            self._root = tkinter.Tk()
        except tkinter.TclError as error:
            raise DeviceError(device, f"there is no screen for its window: {error}; set DISPLAY") from None
        self._root.title(title)
        self._root.protocol("WM_DELETE_WINDOW", self._note_closed)
        self.canvas = tkinter.Canvas(self._root, width=width, height=height, background=BACKGROUND)
        self.canvas.configure(highlightthickness=0)
        self.canvas.pack(fill="both", expand=True)

    def bind(self, sequence: str, take: Any) -> None:
        """Has a function take events, named as tkinter names them, wherever in the window they are."""
        self._root.bind(sequence, take)

    def focus(self) -> None:
        """Asks for the keyboard."""
        self._root.focus_force()

    def wait(self, timeout_s: float) -> None:
        """Deals with the events that have come; if there are none, with the next one.

        Args:
            timeout_s: How long to wait for it [s]; 0 does not wait.

        Raises:
            DeviceClosedError: If the person has closed the window.
            DeviceError: If the window has gone otherwise.
        """
        # Errors that a caller keeps must keep no frame that knows the interpreter, see `close`.
        failure = self._failure_of_waiting(timeout_s)
        if failure:
            raise DeviceError(self._device, f"its window has gone: {failure}")
        if self._is_closed:
            raise DeviceClosedError(self._device, "its window was closed")

    def _failure_of_waiting(self, timeout_s: float) -> str:
        """Deals with events; returns why that cannot be, empty if it can."""
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
        """Closes the window; once."""
        with contextlib.suppress(tkinter.TclError):  # it has gone already
            self._root.destroy()
        del self._root, self.canvas
        gc.collect()  # here: Tcl aborts the process if another thread happens to free what it has

    def _note_closed(self) -> None:
        self._is_closed = True
